// SPDX-License-Identifier: Apache-2.0
// Contribution of a body to the mass and inertia of its link.
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/scene/mass_properties.hpp"

namespace tangere {

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
