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

/// Sums the pyramids between the middle of all faces and each face, as MuJoCo does where a mesh
/// does not say inertia="exact": all count, whichever way a face looks. So the surface may be open,
/// and what several pyramids share counts several times. For a convex surface it is the volume.
MeshSolid solid_of(const MeshShape& faces);

}  // namespace tangere
