// SPDX-License-Identifier: Apache-2.0
// The mass that MuJoCo gives a mesh, which need not be that of what the mesh encloses.
#pragma once

#include <array>

#include "engine/scene/scene.hpp"

namespace tangere {

/// A solid of density 1 kg/m³.
struct MeshSolid {
  double volume = 0;                ///< [m³]
  Vector3 centre{};                 ///< of mass [m]
  std::array<double, 6> inertia{};  ///< xx xy xz yy yz zz about the centre [m⁵]
};

/// Sums the absolute volumes of the pyramids between the mean of all faces and each face, as MuJoCo
/// does for meshes without inertia="exact". The surface may be open, and overlapping pyramids count
/// several times. For a convex surface it is the volume.
MeshSolid solid_of(const MeshShape& faces);

}  // namespace tangere
