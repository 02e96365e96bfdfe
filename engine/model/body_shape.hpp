// SPDX-License-Identifier: Apache-2.0
// The shape of a compiled body: its distance function, widths and outward directions.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Sets shape and size of a body, and whether it can be touched. Meshes get their distance later.
void place_shape(const Shape& shape, CompiledBody& body);
/// Returns the solid of a body that has these contact points.
kernels::Solid solid_of(const Shape& shape, const CompiledBody& body);
/// Whether a shape is convex and its own contact points lie on its surface.
bool is_convex(const Shape& shape);
/// Returns the widths of a convex body. It must have a distance, and be bounded.
kernels::Hull hull_of(const CompiledBody& body);
/// Returns a positive number where a direction points out of a body near a place on its surface,
/// body frame.
double points_outward(const CompiledBody& body, const kernels::Vec3<double>& at,
                      const kernels::Vec3<double>& direction);

}  // namespace tangere
