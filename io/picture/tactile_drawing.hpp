// SPDX-License-Identifier: Apache-2.0
// Layout of pictures of tactile fields: position of each point and direction of its shear arrow.
#pragma once

#include <array>
#include <vector>

#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// A rectangular array, or the image in which the points of a list have pixels.
struct TactileDrawing {
  int rows = 0, cols = 0;
  double height = 0,
         width = 0;  ///< [m]; for an image, the extent of its points along rows and columns
  std::vector<std::array<int, 2>> cell;  ///< (points) row and column; -1: not drawn
  std::vector<std::array<double, 4>>
      turn;  ///< (points) from force along axis0, axis1 to down, right; empty: see below
  double down = 1,
         right = 1;  ///< arrays: whether rows go down along axis0 and columns right along axis1

  /// Returns the components {down, right} of a force along axis0 and axis1.
  [[nodiscard]] std::array<double, 2> shear(std::size_t point, double f0, double f1) const;
};

/// Whether a sensor can be drawn: an array, or a list with pixels for some of its points.
bool drawable(const SensorLayout& sensor);
TactileDrawing drawing_of(const SensorLayout& sensor);

}  // namespace tangere
