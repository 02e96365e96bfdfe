// SPDX-License-Identifier: Apache-2.0
// Rows of the table of shapes, for bodies that are placed on a link.
#include "engine/model/body_shape.hpp"

#include <algorithm>
#include <cmath>

#include "engine/scene/frames.hpp"
#include "engine/scene/shapes.hpp"
#include "kernels/contact/distance.hpp"

namespace tangere {

using kernels::Vec3;

void place_shape(const Shape& shape, CompiledBody& body) {
  const ShapeRow& row = row_of(shape);
  body.touchable = row.distance.has_value() && row.distance != PrimitiveShape::mesh;
  if (row.distance.has_value()) body.shape = *row.distance;
  body.size = vec3_of(size_in_kernels(shape));
  if (body.touchable) {
    body.extent = std::sqrt(dot(body.size, body.size));
    return;
  }
  const std::vector<double> p = contact_points(shape);
  for (std::size_t k = 0; k < p.size(); k += 3)
    body.extent = std::max(body.extent, std::hypot(p[k], p[k + 1], p[k + 2]));
}

kernels::Solid solid_of(const Shape& shape, const CompiledBody& body) {
  return {body.frame, row_of(shape).stretches(), body.shape, body.size};
}

bool is_convex(const Shape& shape) {
  return row_of(shape).stretches() && row_of(shape).distance.has_value() &&
         !std::holds_alternative<MeshShape>(shape);
}

kernels::Hull hull_of(const CompiledBody& body) {
  const ShapeRow& row = row_of(body.shape);
  if (row.half_widths == nullptr) return {body.frame, {}, {}, false, 0};
  const HalfWidths half = row.half_widths({body.size.x, body.size.y, body.size.z});
  const Vec3<double> straight = vec3_of(half.straight), round = vec3_of(half.round);
  const double most = std::max({round.x, round.y, round.z});
  return {body.frame, straight, round, most > 0, std::sqrt(dot(straight, straight)) + most};
}

void meet_faces(kernels::PairContact& pair, const CompiledBody& body) {
  constexpr double kOverhang = 1e-3;
  pair.faced = true;
  pair.hull = hull_of(body);
  const Vec3<double>&a = pair.size, &b = pair.hull.straight, &c = pair.hull.round;
  pair.overhang = kOverhang * std::min({a.x, a.y, a.z, b.x + c.x, b.y + c.y, b.z + c.z});
}

double points_outward(const CompiledBody& body, const Vec3<double>& at,
                      const Vec3<double>& direction) {
  if (!body.touchable) return dot(direction, at - body.centre);
  return dot(direction,
             kernels::with_distance<double>(
                 body.shape, body.size,
                 [&](const auto& shape) { return kernels::distance_at(shape, at).n; }, body.grid));
}

}  // namespace tangere
