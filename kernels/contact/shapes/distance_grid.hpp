// SPDX-License-Identifier: Apache-2.0
// The distance to a mesh as kernels see it: numbers on a grid, no ownership. spline.hpp evaluates
// them, engine/model/mesh_grid.hpp makes them.
#pragma once

namespace tangere::kernels {

/// Coefficients of a spline and its place in the shape's axes.
struct DistanceGrid {
  /// (cells[0] + 3, cells[1] + 3, cells[2] + 3) [m]
  const float* coefficients;
  int cells[3];
  int row, plane;          ///< distance in memory from one y and one x to the next
  double origin[3];        ///< lowest corner of the first cell [m]
  double cell;             ///< its edge [m]
  double slope;            ///< no smaller than any |∇φ| where φ > 0
  double low[3], high[3];  ///< a box outside of which nothing touches, inside the grid [m]
};

}  // namespace tangere::kernels
