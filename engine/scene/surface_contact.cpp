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

constexpr double kDefaultPoints = 20000;    // of one surface, about, unless the scene gives a pitch
constexpr double kMostGivenPoints = 1e6;    // with a pitch that the scene gives
constexpr double kAcrossBody = 8;           // pitches across the second smallest width of a body
constexpr double kAcrossThin = 2.5;         // pitches of a round body across the other's smallest
constexpr double kAcrossPlace = 0.7;        // pitch in half widths of the place of contact
constexpr double kAcrossFace = 1.4;         // the same of faces on which a rod lies
constexpr double kAlongRod = 16;            // rings of a rod that lies on a face
constexpr double kFine = 1.5, kUneven = 4;  // pitches over the wanted one: near enough, uneven
constexpr double kThin = 4;                 // least thickness, in depths under the lighter weight
constexpr double kUsualGravity = 9.81;      // where the scene has none [m/s²]

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

/// The smallest width of a shape [m]; of a mesh the mean thickness of its walls, if that is less.
/// That of a plate is twice its volume over its area.
double thickness(const Shape* shape) {
  double least = ascending_widths(shape)[0];
  if (shape != nullptr && std::holds_alternative<MeshShape>(*shape))
    least = std::min(least, 2 * volume_of(*shape) / surface_area(*shape));
  return least;
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

/// The place of contact of two shapes under a force [m]; infinitely wide and not deep between
/// faces.
struct Place {
  double half_width = HUGE_VAL, depth = 0;
};
Place place_of(const Shape* one, const Shape* two, double stiffness, double force) {
  const double radius = 1 / (1 / roundness(one) + 1 / roundness(two));
  if (std::isinf(radius) || !(force > 0)) return {};
  double line = 0;  // no longer than the other body is wide
  for (const auto& [round, other] : {std::pair{one, two}, {two, one}})
    if (straight_length(round) > 0 && std::isinf(roundness(other)))
      line = std::min(straight_length(round), ascending_widths(other)[1]);
  const double depth =
      line > 0 ? std::pow(force / (stiffness * line * 4 / 3 * std::sqrt(2 * radius)), 2.0 / 3)
               : std::sqrt(force / (std::numbers::pi * stiffness * radius));
  return {std::sqrt(2 * radius * std::min(depth, radius)), depth};
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
  const SurfacePitch pitch = fitting_pitch(scene, d, first);
  pair.spacing = std::max(pitch.across, pitch.along);
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
  const std::array<double, 3> mine = ascending_widths(own), its = ascending_widths(other);
  const bool round = !std::isinf(roundness(own)), on_face = std::isinf(roundness(other));
  double narrow = std::min(mine[1], its[1]) / kAcrossBody;
  if (round && on_face) narrow = std::min(narrow, thickness(other) / kAcrossThin);
  const double touching =
      place_of(own, other, d.coefficients.kn, lighter_weight(scene, d)).half_width;
  // Where a rod lies on a face, its own points resolve the line.
  const double share = !round && straight_length(other) > 0 ? kAcrossFace : kAcrossPlace;
  const double across = std::min(narrow, share * touching);
  SurfacePitch pitch{across, across, across};
  if (straight_length(own) > 0 && on_face)  // along a line of contact less is to be resolved
    pitch.along = std::min(narrow, straight_length(own) / kAlongRod);
  if (d.pitch) {
    pitch.across = pitch.along = *d.pitch;
  } else {
    while (expected_points(*own, pitch.across, pitch.along) > kDefaultPoints) {
      pitch.across *= 1.05, pitch.along *= 1.05;
      pitch.bounded = true;
    }
  }
  pitch.coarse = pitch.across > kUneven * pitch.target;
  return pitch;
}

namespace {

/// Shares of the stiffness at the points of body1 and body2. Edges and corners go between the
/// points of a surface, so both bodies have points where one has faces. Of two round bodies, the
/// one with the smaller surface has them. A body whose points would be too far apart has none where
/// the other one's are not.
std::array<double, 2> shares(const Scene& scene, const SurfaceContactDescription& d) {
  const Shape *const one = shape_of(scene, d.body1), *const two = shape_of(scene, d.body2);
  const bool first = one != nullptr && has_surface(*one),
             second = two != nullptr && has_surface(*two);
  if (!first || !second) return {first ? 1.0 : 0.0, second ? 1.0 : 0.0};
  const auto alone = [](bool first_only) {
    return std::array{first_only ? 1.0 : 0.0, first_only ? 0.0 : 1.0};
  };
  const auto is_fine = [](const SurfacePitch& p) { return p.across <= kFine * p.target; };
  const bool fine1 = is_fine(fitting_pitch(scene, d, true)),
             fine2 = is_fine(fitting_pitch(scene, d, false));
  if (fine1 != fine2) return alone(fine1);
  if (!std::isinf(roundness(one)) && !std::isinf(roundness(two)))
    return alone(surface_area(*one) <= surface_area(*two));
  return {0.5, 0.5};
}

/// What is wrong with a pitch that the scene gives; "" if nothing is.
std::string pitch_fault(const Scene& scene, const SurfaceContactDescription& d) {
  for (const std::string& name : {d.body1, d.body2}) {
    const Shape* const shape = shape_of(scene, name);
    if (!d.pitch || shape == nullptr || !has_surface(*shape)) continue;
    const double count = expected_points(*shape, *d.pitch, *d.pitch);
    if (!(count <= kMostGivenPoints))
      return fmt::format("pitch=\"{}\" gives '{}' about {:.2g} points; expected {:.2g} or more",
                         *d.pitch, name, count, *d.pitch * std::sqrt(count / kMostGivenPoints));
  }
  return "";
}

/// A warning where a body is so thin, and the contact so soft, that the other one may come out on
/// the far side under its weight; "" if not.
std::string thin_warning(const Scene& scene, const SurfaceContactDescription& d) {
  const Shape *const one = shape_of(scene, d.body1), *const two = shape_of(scene, d.body2);
  const double depth = place_of(one, two, d.coefficients.kn, lighter_weight(scene, d)).depth;
  for (const std::string& name : {d.body1, d.body2}) {
    const double thin = thickness(shape_of(scene, name));
    if (depth > 0 && thin < kThin * depth)
      return fmt::format(
          "{}<surface_contact>: '{}' is {:.2g} m thin, and the lighter of '{}' and '{}' sinks in "
          "by "
          "{:.2g} m under its weight, so it may come out on the other side; expected a kn of "
          "{:.1g} "
          "or more",
          d.source.prefix(), name, thin, d.body1, d.body2, depth,
          d.coefficients.kn * std::pow(kThin * depth / thin, 2));
  }
  return "";
}

}  // namespace

std::string contact_fault(const Scene& scene, const SurfaceContactDescription& d) {
  if (d.body1 == d.body2) return "body '" + d.body1 + "' against itself; expected two bodies";
  for (const PairContactDescription& c : scene.pair_contacts)
    if (c.per_area() &&
        std::minmax(c.general_body, c.primitive_body) == std::minmax(d.body1, d.body2))
      return fmt::format("'{}' and '{}' touch already (line {}); expected one contact of them",
                         d.body1, d.body2, c.source.line);
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
  if (std::string fault = pitch_fault(scene, d); !fault.empty()) return fault;
  return value_fault(kSurfaceContact, d.coefficients);
}

std::vector<std::string> add_surface_contact(Scene& scene, const SurfaceContactDescription& d) {
  if (const std::string fault = contact_fault(scene, d); !fault.empty())
    throw InputError(d.source.prefix() + "<surface_contact>: " + fault);
  const std::array<double, 2> share = shares(scene, d);
  std::vector<std::string> warnings;
  for (const bool first : {true, false}) {
    if (!(share[first ? 0 : 1] > 0)) continue;
    scene.pair_contacts.push_back(half_contact(scene, d, first, share[first ? 0 : 1]));
    scene.pair_contacts.back().second_half = !first && share[0] > 0;
    const SurfacePitch pitch = fitting_pitch(scene, d, first);
    if (!pitch.coarse) continue;
    warnings.push_back(fmt::format(
        "{}<surface_contact>: the {} points of '{}' are {:.2g} m apart; under the lighter body's "
        "weight its contact with '{}' is uneven unless they are {:.2g} m apart; expected a smaller "
        "kn, or a pitch of {:.2g}",
        d.source.prefix(), scene.pair_contacts.back().areas.size(), first ? d.body1 : d.body2,
        pitch.across, first ? d.body2 : d.body1, pitch.target, pitch.target));
  }
  if (std::string thin = thin_warning(scene, d); !thin.empty()) warnings.push_back(std::move(thin));
  return warnings;
}

}  // namespace tangere
