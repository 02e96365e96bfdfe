// SPDX-License-Identifier: Apache-2.0
// Error of a mesh's distance grid at the surface. It is large where walls are thinner than cells.
#pragma once

#include "engine/scene/scene.hpp"
#include "kernels/contact/shapes/distance_grid.hpp"

namespace tangere {

struct MeshFit {
  double error = 0;  ///< root of the mean square of the distance on the surface, which is 0 [m]
  /// Share of the surface's area where the distance is off by more than a tenth of a cell, or its
  /// gradient along the triangle's normal is below a half, or where the wall is thinner than about
  /// 1.4 cells, so that this gradient has turned 0.9 cells below.
  double unresolved = 0;
};

/// Compares the grid with its mesh at ten thousand places or more: evenly over the area, at least
/// one in each triangle.
MeshFit mesh_fit(const MeshShape& mesh, const kernels::DistanceGrid& grid);

}  // namespace tangere
