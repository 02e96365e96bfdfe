// SPDX-License-Identifier: Apache-2.0
// View of the spline coefficients of a mesh's signed distance on a grid; no ownership. spline.hpp
// evaluates them, engine/model/mesh_grid.hpp computes them.
#pragma once

namespace tangere::kernels {

inline constexpr int kQuad = 4;      ///< coefficients along z that lie side by side
inline constexpr int kRim = 2;       ///< cells along every side of a grid in which nothing touches
inline constexpr int kSagBlock = 4;  ///< edge of a block of cells

/// Coefficients of a spline and its place in the shape's axes.
struct DistanceGrid {
  /// (cells[1] + 3, cells[2], cells[0] + 3, 4) for y, z, x: the coefficients at z … z + 3 [m]. The
  /// sixteen of a place at one y are neighbours in memory, x by x.
  const float* coefficients;
  /// (cells[1], cells[2], cells[0] + 3) for y, z, x: φ is nowhere less in the cell, by however
  /// much single precision rounds [m]
  const float* floors;
  /// (blocks along x, y, z) how far φ bends downwards in a block and its neighbours: no less than
  /// -vᵀ∇∇φ v for any unit vector v, lengths in cells [m]. Only places with φ > 0 have a part in
  /// it, from which φ can fall to 0 within kSagBlock cells.
  const float* sags;
  int cells[3];
  int row, plane;          ///< strides of z and y
  double origin[3];        ///< lowest corner of the first cell [m]
  double cell;             ///< its edge [m]
  double slope;            ///< no smaller than any |∇φ| where φ > 0
  double low[3], high[3];  ///< a box outside of which nothing touches, inside the grid [m]
};

}  // namespace tangere::kernels
