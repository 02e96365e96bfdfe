// SPDX-License-Identifier: Apache-2.0
// How deep a body sinks in under its weight F follows from Winkler's foundation. With R the radius
// of curvature of the gap between the surfaces, and L the length of a line of contact,
//   a line, F = 4/3 K L √(2R) δ^(3/2);   a place, F = π K R δ²;   half width a = √(2Rδ)
#include "engine/scene/surface_contact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/scene/mass_properties.hpp"
#include "engine/scene/scene_faults.hpp"
#include "engine/scene/schema.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/scene/surface_points.hpp"

namespace tangere {

namespace {

constexpr double kMostPoints = 20000;   // of one surface, unless the scene gives a pitch
constexpr double kAcrossBody = 8;       // pitches across the second smallest width of a body
constexpr double kAcrossPlace = 0.7;    // pitch in half widths of the place of contact
constexpr double kUsualGravity = 9.81;  // where the scene has none [m/s²]

int body_index(const Scene& scene, const std::string& name) {
  for (std::size_t k = 0; k < scene.links.size(); ++k)
    if (scene.links[k].body.name == name) return static_cast<int>(k);
  return -1;
}
const Shape* shape_of(const Scene& scene, const std::string& body) {
  const int k = body_index(scene, body);
  return k < 0 ? nullptr : &scene.links[std::size_t(k)].body.shape;
}

/// Full widths of a shape, ascending [m]; infinite without an end.
std::array<double, 3> ascending_widths(const Shape* shape) {
  std::array<double, 3> w = {HUGE_VAL, HUGE_VAL, HUGE_VAL};
  if (shape == nullptr) return w;
  if (const auto* const mesh = std::get_if<MeshShape>(shape)) {
    std::array<double, 3> low = w, high = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (std::size_t k = 0; k < mesh->vertices.size(); ++k) {
      low[k % 3] = std::min(low[k % 3], mesh->scale * mesh->vertices[k]);
      high[k % 3] = std::max(high[k % 3], mesh->scale * mesh->vertices[k]);
    }
    for (std::size_t k = 0; k < 3; ++k) w[k] = high[k] - low[k];
  } else if (row_of(*shape).half_widths != nullptr) {
    w = widths(*shape);
  }
  std::ranges::sort(w);
  return w;
}

/// Radius by which a shape is round [m]; infinite for one with faces.
double roundness(const Shape* shape) {
  if (shape == nullptr) return HUGE_VAL;
  if (const auto* const s = std::get_if<SphereShape>(shape)) return s->radius;
  if (const auto* const s = std::get_if<CylinderShape>(shape)) return s->radius;
  if (const auto* const s = std::get_if<CapsuleShape>(shape)) return s->radius;
  if (std::holds_alternative<EllipsoidShape>(*shape)) return 0.5 * ascending_widths(shape)[0];
  return HUGE_VAL;
}
/// Length of the straight part of a round shape; 0: it has none.
double straight_length(const Shape* shape) {
  if (shape == nullptr) return 0;
  if (const auto* const s = std::get_if<CylinderShape>(shape)) return s->length;
  if (const auto* const s = std::get_if<CapsuleShape>(shape)) return s->length;
  return 0;
}

/// The weight of the lighter of two bodies that can move, or of those that lie free if one does
/// [N]; 0 where both are fixed.
double lighter_weight(const Scene& scene, const SurfaceContactDescription& d) {
  const double g = std::sqrt(dot(scene.gravity, scene.gravity));
  double free = HUGE_VAL, moving = HUGE_VAL;
  for (const std::string& name : {d.body1, d.body2}) {
    const int k = body_index(scene, name), mover = k < 0 ? -1 : moving_link(scene, k);
    if (mover < 0) continue;
    const BodyDescription& body = scene.links[std::size_t(k)].body;
    const double mass = mass_properties(body.shape, body.density).mass;
    if (!(mass > 0)) continue;
    const JointType type = scene.links[std::size_t(mover)].joint.type;
    double& least = type == JointType::free || type == JointType::free2d ? free : moving;
    least = std::min(least, mass);
  }
  const double mass = std::isinf(free) ? moving : free;
  return std::isinf(mass) ? 0 : mass * (g > 0 ? g : kUsualGravity);
}

/// Half width of the place of contact of two shapes under a force [m]; infinite between faces.
double half_width(const Shape* one, const Shape* two, double stiffness, double force) {
  const double radius = 1 / (1 / roundness(one) + 1 / roundness(two));
  if (std::isinf(radius) || !(force > 0)) return HUGE_VAL;
  double line = 0;  // no longer than the other body is wide
  for (const auto& [round, other] : {std::pair{one, two}, {two, one}})
    if (straight_length(round) > 0 && std::isinf(roundness(other)))
      line = std::min(straight_length(round), ascending_widths(other)[1]);
  const double depth =
      line > 0 ? std::pow(force / (stiffness * line * 4 / 3 * std::sqrt(2 * radius)), 2.0 / 3)
               : std::sqrt(force / (std::numbers::pi * stiffness * radius));
  return std::sqrt(2 * radius * std::min(depth, radius));
}

/// The points of a body, as a contact with another one. `share`: of the stiffness.
PairContactDescription half_contact(const Scene& scene, const SurfaceContactDescription& d,
                                    bool first, double share) {
  PairContactDescription pair;
  pair.general_body = first ? d.body1 : d.body2;
  pair.primitive_body = first ? d.body2 : d.body1;
  pair.on_ground = body_index(scene, pair.primitive_body) < 0;
  pair.coefficients = d.coefficients;
  pair.law = d.law;
  pair.source = d.source;
  const SurfacePitch pitch =
      d.pitch ? SurfacePitch{*d.pitch, *d.pitch, 0} : fitting_pitch(scene, d, first);
  SurfacePoints points =
      surface_points(*shape_of(scene, pair.general_body), pitch.across, pitch.along);
  for (double& area : points.areas) area *= share;
  pair.points = std::move(points.places);
  pair.areas = std::move(points.areas);
  return pair;
}

}  // namespace

SurfacePitch fitting_pitch(const Scene& scene, const SurfaceContactDescription& d, bool first) {
  const Shape* const own = shape_of(scene, first ? d.body1 : d.body2);
  const Shape* const other = shape_of(scene, first ? d.body2 : d.body1);
  const double narrow =
      std::min(ascending_widths(other)[1] / kAcrossBody, ascending_widths(own)[1] / kAcrossBody);
  const double touching = half_width(own, other, d.coefficients.kn, lighter_weight(scene, d));
  const double across = std::min(narrow, kAcrossPlace * touching);
  SurfacePitch pitch{across, across, across};
  // A line of contact with a face is not resolved along the line.
  if (straight_length(own) > 0 && std::isinf(roundness(other)))
    pitch.along = std::min(narrow, straight_length(own) / kAcrossBody);
  const double count = surface_area(*own) / (pitch.across * pitch.along);
  if (count > kMostPoints) {
    const double grown = std::sqrt(count / kMostPoints);
    pitch.across *= grown, pitch.along *= grown;
    pitch.bounded = true;
    pitch.coarse = pitch.across > std::min(touching, kAcrossBody / 2 * narrow);
  }
  return pitch;
}

namespace {

/// Shares of the stiffness at the points of body1 and body2. Edges and corners go between the
/// points of a face, so both of two shapes with faces have points. A round shape resolves its
/// contacts alone: of two, the one with the smaller surface. A body that would need too many points
/// has none where the other one does not.
std::array<double, 2> shares(const Scene& scene, const SurfaceContactDescription& d) {
  const Shape *const one = shape_of(scene, d.body1), *const two = shape_of(scene, d.body2);
  const bool first = one != nullptr && has_surface(*one),
             second = two != nullptr && has_surface(*two);
  if (!first || !second) return {first ? 1.0 : 0.0, second ? 1.0 : 0.0};
  const bool round1 = !std::isinf(roundness(one)), round2 = !std::isinf(roundness(two));
  const bool smaller = surface_area(*one) <= surface_area(*two);
  const bool few1 = d.pitch || !fitting_pitch(scene, d, true).bounded,
             few2 = d.pitch || !fitting_pitch(scene, d, false).bounded;
  if (few1 == few2 && !round1 && !round2) return {0.5, 0.5};
  const bool by_first = few1 != few2 ? few1 : round1 && round2 ? smaller : round1;
  return {by_first ? 1.0 : 0.0, by_first ? 0.0 : 1.0};
}

}  // namespace

std::string contact_fault(const Scene& scene, const SurfaceContactDescription& d) {
  if (d.body1 == d.body2) return "body '" + d.body1 + "' against itself; expected two bodies";
  bool covered = false;
  for (const std::string& name : {d.body1, d.body2}) {
    const Shape* const shape = shape_of(scene, name);
    if (shape == nullptr) {
      if (name == d.body1 || name != kGroundName) return "there is no body '" + name + "'";
      if (!scene.ground) return "the scene has no <ground> for '" + d.body1 + "' to touch";
      continue;
    }
    if (!has_distance(*shape))
      return fmt::format(
          "'{}' is {} body, which has no surface; expected {}", name,
          with_article(shape_name(*shape)),
          std::holds_alternative<MeshShape>(*shape)
              ? "a resolution of 1 or more"
              : shapes_with([](const ShapeRow& r) { return r.distance.has_value(); }));
    covered = covered || has_surface(*shape);
  }
  if (!covered)
    return fmt::format("'{}' and '{}' have no end; expected one body with a bounded surface",
                       d.body1, d.body2);
  if (d.law == ContactLaw::linear) return "law=\"linear\"; expected clamped or paper";
  if (!(d.coefficients.kn > 0)) {
    const double weight = lighter_weight(scene, d);
    std::string such;
    for (const std::string& name : {d.body1, d.body2}) {
      const std::array<double, 3> w = ascending_widths(shape_of(scene, name));
      if (such.empty() && weight > 0 && !std::isinf(w[2]))
        such = fmt::format(
            "; with {:.1g} the lighter body would rest about 0.1 percent of its "
            "width deep",
            weight / (w[1] * w[2] * 1e-3 * w[0]));
    }
    return fmt::format("kn=\"{}\"; expected a positive stiffness by area [N/m^3]{}",
                       d.coefficients.kn, such);
  }
  return value_fault(kSurfaceContact, d.coefficients);
}

std::string add_surface_contact(Scene& scene, const SurfaceContactDescription& d) {
  if (const std::string fault = contact_fault(scene, d); !fault.empty())
    throw InputError(d.source.prefix() + "<surface_contact>: " + fault);
  const std::array<double, 2> share = shares(scene, d);
  std::string warning;
  for (const bool first : {true, false}) {
    if (!(share[first ? 0 : 1] > 0)) continue;
    scene.pair_contacts.push_back(half_contact(scene, d, first, share[first ? 0 : 1]));
    scene.pair_contacts.back().second_half = !first && share[0] > 0;
    const SurfacePitch pitch = fitting_pitch(scene, d, first);
    if (d.pitch || !pitch.coarse) continue;
    warning = fmt::format(
        "{}<surface_contact>: the {} points of '{}' are {:.2g} m apart; under the lighter body's "
        "weight its contact with '{}' is uneven unless they are {:.2g} m apart; expected a smaller "
        "kn, or a pitch of {:.2g}",
        d.source.prefix(), scene.pair_contacts.back().areas.size(), first ? d.body1 : d.body2,
        pitch.across, first ? d.body2 : d.body1, pitch.wanted, pitch.wanted);
  }
  return warning;
}

}  // namespace tangere
