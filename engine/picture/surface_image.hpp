// SPDX-License-Identifier: Apache-2.0
// Heights and slopes of a surface at the pixels of a picture. The surface h on the points' grid is
// blurred by a Gaussian and read by approximating cubic B-splines. These blur by pitch²/3 on their
// own, so the Gaussian has the variance b² - pitch²/3, or none.
#pragma once

#include <span>
#include <vector>

#include "engine/picture/picture_grid.hpp"

namespace tangere {

/// T: float or double. Owns the scratch of one thread. Only the constructor and the first
/// begin_pull_back() allocate.
template <class T>
class SurfaceImage {
 public:
  /// `blur`: b [m]. `outside`: the surface outside of the grid.
  SurfaceImage(const PictureGrid& grid, double blur, Outside outside = Outside::zero);

  /// Takes the surface, (rows, cols) [m].
  void set(std::span<const T> surface);
  /// Whether the surface is 0 wherever a row of pixels is computed from it.
  [[nodiscard]] bool is_flat(int row) const;
  /// Computes the height [m] of a row of pixels, (width).
  void read_heights(int row, std::span<T> height) const;
  /// Computes the slopes ∂h/∂x and ∂h/∂y of a row of pixels, (width) each.
  void read_slopes(int row, std::span<T> p, std::span<T> q) const;

  /// Pulls cotangents of rows back to the surface: begin, add rows, then take.
  void begin_pull_back();
  void add_heights(int row, std::span<const T> height_bar);
  void add_slopes(int row, std::span<const T> p_bar, std::span<const T> q_bar);
  /// Computes the cotangent of the surface, (rows, cols).
  void take(std::span<T> surface_bar);

 private:
  void blur(std::vector<T>& grid);
  void pull_back_blur(std::vector<T>& grid);
  [[nodiscard]] std::span<T> line(std::vector<T>& rows, int row) const;
  [[nodiscard]] std::span<const T> line(const std::vector<T>& rows, int row) const;

  PictureGrid grid_;
  Outside outside_;
  std::vector<T> kernel_x_, kernel_y_;  // from the middle outwards; one number: no blur
  std::vector<SplineWeights<T>> columns_, lines_;
  std::vector<T> blurred_, passed_;  // (rows, cols)
  std::vector<T> across_, slope_;    // (rows, width): h and ∂h/∂x of grid rows at all columns
  std::vector<T> across_bar_, slope_bar_;  // their cotangents
  std::vector<bool> flat_;                 // (rows) of the grid
};

}  // namespace tangere
