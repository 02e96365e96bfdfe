// SPDX-License-Identifier: Apache-2.0
// The distance to a mesh as kernels see it: numbers on a grid, no ownership. spline.hpp evaluates
// them, engine/model/mesh_grid.hpp makes them.
#pragma once

namespace tangere::kernels {

inline constexpr int kQuad = 4;  ///< coefficients along z that lie side by side
inline constexpr int kRim = 2;   ///< cells along every side of a grid in which nothing touches
/// Blocks of cells are cubes with edges of kSagBlock cells, and in each level twice those of the
/// level before.
inline constexpr int kSagLevels = 2, kSagBlock = 4;
/// How far from a place the tables reach, in cells.
inline constexpr double kSagReach = kSagBlock << (kSagLevels - 1);

/// Coefficients of a spline and its place in the shape's axes.
struct DistanceGrid {
  /// (cells[1] + 3, cells[2], cells[0] + 3, 4) for y, z, x: the coefficients at z … z + 3 [m]. The
  /// sixteen of a place at one y are neighbours in memory, x by x.
  const float* coefficients;
  /// (cells[1], cells[2], cells[0] + 3) for y, z, x: φ is nowhere less in the cell, by however
  /// much single precision rounds [m]
  const float* floors;
  int cells[3];
  int row, plane;          ///< distance in memory from one z and one y to the next
  double origin[3];        ///< lowest corner of the first cell [m]
  double cell;             ///< its edge [m]
  double slope;            ///< no smaller than any |∇φ| where φ > 0
  /// For each level a table of blocks, x by x, z fastest: no less than -vᵀ∇∇φ v for any unit vector
  /// v, wherever φ > 0 in the block and its neighbours; U is in cells [m]
  const float* sags[kSagLevels];
  double low[3], high[3];  ///< a box outside of which nothing touches, inside the grid [m]
};

}  // namespace tangere::kernels
