// SPDX-License-Identifier: Apache-2.0
// Where the pixels of a picture lie on the grid of a sensor's points. Rows count down, columns to
// the right; the picture's middle is that of the grid.
#pragma once

#include <array>
#include <vector>

namespace tangere {

struct PictureGrid {
  int rows = 0, cols = 0;           ///< points
  double pitch_x = 0, pitch_y = 0;  ///< of columns and rows [m], positive
  int height = 0, width = 0;        ///< pixels
  double size_x = 0, size_y = 0;    ///< width and height of the picture [m]

  [[nodiscard]] int points() const { return rows * cols; }
  [[nodiscard]] int pixels() const { return height * width; }
};

/// Cubic B-spline of one axis at one place: four points, their weights, and those of the
/// derivative by the place in points.
template <class T>
struct SplineWeights {
  std::array<int, 4> point{};
  std::array<T, 4> value{}, slope{};
};

/// What happens to points outside of the grid: they are 0, or equal to the nearest one inside.
enum class Outside { zero, nearest };

/// Returns the weights at place `at` of an axis of `points` points, the first at 0.
template <class T>
SplineWeights<T> spline_weights(double at, int points, Outside outside);

/// Returns the weights at all pixels of an axis of `size` [m] over points `pitch` [m] apart.
template <class T>
std::vector<SplineWeights<T>> pixel_weights(int pixels, double size, int points, double pitch,
                                            Outside outside);

}  // namespace tangere
