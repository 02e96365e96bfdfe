// SPDX-License-Identifier: Apache-2.0
// Mass and inertia of a body, and its contribution to its link.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Mass properties of a body, in its own axes. Inertia is about its centre of mass.
struct MassProperties {
  double mass;                    ///< [kg]
  kernels::Vec3<double> centre;   ///< centre of mass, body frame [m]
  kernels::Mat3<double> inertia;  ///< [kg m²]
};
MassProperties mesh_mass(const MeshShape& mesh, double density);
/// Returns the contribution of a body with these properties to its link.
InertiaRows inertia_rows(const CompiledBody& body, const MassProperties& properties);
/// Returns the derivative of that for a change `by` of the properties.
InertiaRows inertia_slopes(const CompiledBody& body, const MassProperties& properties,
                           const MassProperties& by);
/// Returns the rows of a link's own inertia.
InertiaRows inertia_rows(const kernels::Link& link);
/// Adds a body to its link.
void add_inertia(kernels::Link& link, const CompiledBody& body, const MassProperties& properties);

}  // namespace tangere
