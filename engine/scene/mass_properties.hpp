// SPDX-License-Identifier: Apache-2.0
// Mass and inertia of a body in its own axes.
#pragma once

#include "engine/scene/scene.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere {

/// Mass properties of a body, in its own axes. Inertia is about its centre of mass.
struct MassProperties {
  double mass;                    ///< [kg]
  kernels::Vec3<double> centre;   ///< centre of mass, body frame [m]
  kernels::Mat3<double> inertia;  ///< [kg m²]
};
MassProperties mesh_mass(const MeshShape& mesh, double density);

}  // namespace tangere
