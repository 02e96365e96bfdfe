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
/// Bodies with more points have some inside the face that they touch, so the nearest face serves
/// them, and a point that slides over the edge of a chosen face loses its force at once.
inline constexpr int kMostFacePoints = 8;
/// Sets up contact of a convex body with single faces of a cuboid. Points beyond the face's edges
/// by up to a thousandth of the smaller body still touch it: otherwise rounding would decide
/// whether corners of flush boxes touch. This is far above rounding and the sway of stacks, and
/// far below the spacing of contact points.
void meet_faces(kernels::PairContact& pair, const CompiledBody& body);
/// Returns a positive number where a direction points out of a body near a place on its surface,
/// body frame.
double points_outward(const CompiledBody& body, const kernels::Vec3<double>& at,
                      const kernels::Vec3<double>& direction);

}  // namespace tangere
