// SPDX-License-Identifier: Apache-2.0
// Makes the distance to a mesh: exact at the nodes of a grid, a spline between them.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "engine/model/mesh_fit.hpp"
#include "engine/scene/scene.hpp"
#include "kernels/contact/shapes/distance_grid.hpp"

namespace tangere {

struct MeshGrid {
  kernels::DistanceGrid view{};
  std::vector<float> coefficients, floors, sags;
  MeshFit fit;

  MeshGrid() = default;
  MeshGrid(const MeshGrid&) = delete;  // the view points into the coefficients
  MeshGrid& operator=(const MeshGrid&) = delete;

  [[nodiscard]] std::size_t bytes() const {
    return (coefficients.size() + floors.size() + sags.size()) * sizeof(float);
  }
};

/// Returns the distance to a closed mesh with `mesh.resolution` cells along its longest side.
/// Throws InputError with the position if the surface overlaps itself, so that parts of it lie
/// inside.
std::shared_ptr<const MeshGrid> make_mesh_grid(const MeshShape& mesh);

/// Returns the grid of an equal mesh that some model of this process holds, or makes one. May be
/// called from any thread; one grid is made at a time.
std::shared_ptr<const MeshGrid> shared_mesh_grid(const MeshShape& mesh);

/// Returns the coarsest of some grids whose error keeps to `mesh.error`, or that of
/// `mesh.resolution` where the mesh has none. Throws InputError where the finest grid does not.
std::shared_ptr<const MeshGrid> fitting_mesh_grid(const MeshShape& mesh);

/// Returns a grid of few cells for checks of deep overlap: three across the mesh's smallest width,
/// at least 16 and at most 64 along its longest side.
std::shared_ptr<const MeshGrid> coarse_mesh_grid(const MeshShape& mesh);

}  // namespace tangere
