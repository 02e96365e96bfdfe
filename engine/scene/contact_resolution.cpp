// SPDX-License-Identifier: Apache-2.0
// Compares distances between contact points with the widths of the bodies that they touch.
//
// A round body of radius r that touches with n points around rolls over a polygon. Its corners
// stand s = r (1 - cos(π/n)) above the middles of its edges. It rolls smoothly where s is no more
// than the depth d = m |g|/(2 k_n) at which two points carry its weight:  n ≥ π/acos(1 - d/r). Of
// an ellipsoid with points a gap e apart and the longest semi-axis a, s = e²/(8 a).
#include "engine/scene/contact_resolution.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>

#include "engine/scene/mass_properties.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {

namespace {

constexpr int kTriedPlaces = 500;
/// Share by which a body may be wider than the gap and still fit.
constexpr double kAsWide = 1e-3;

/// Returns the link with a body; null where there is none of that name.
const LinkDescription* link_with(const Scene& scene, const std::string& body) {
  const auto found = std::ranges::find_if(
      scene.links, [&](const LinkDescription& l) { return l.body.name == body; });
  return found == scene.links.end() ? nullptr : &*found;
}

using Places = std::vector<Vector3>;

Vector3 around_z(double radius, double angle, double z) {
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

/// Returns the places between rings of points, and half way between the points of a ring: on the
/// side and on an end face.
Places places_of(const CylinderShape& shape) {
  const double half = std::numbers::pi / shape.contact_angles;
  Places places = {around_z(shape.radius, half, 0)};
  for (int k = 1; k <= shape.contact_rings; ++k)
    for (const double between : {0.0, 0.5})
      places.push_back(
          around_z(shape.radius * (k - between) / shape.contact_rings, half, shape.length / 2));
  return places;
}
/// The same on the straight part and on a cap.
Places places_of(const CapsuleShape& shape) {
  constexpr int kPolar = 8;
  const double half = std::numbers::pi / shape.contact_angles,
               pitch = shape.length / std::max(1, shape.contact_rings - 1);
  Places places = {around_z(shape.radius, half, (shape.length - pitch) / 2)};
  for (int k = 0; k <= kPolar; ++k) {
    const double polar = std::numbers::pi / 2 * k / kPolar;
    places.push_back(around_z(shape.radius * std::sin(polar), half,
                              shape.length / 2 + shape.radius * std::cos(polar)));
  }
  return places;
}
/// Returns places that are spread as the points are, by another spiral.
Places places_of(const EllipsoidShape& shape) {
  constexpr double kTurn = std::numbers::pi * (3 - 2.23606797749978969);  // golden angle [rad]
  Places places;
  for (int k = 0; k < kTriedPlaces; ++k) {
    const double z = 1 - (2 * k + 1.0) / kTriedPlaces;
    const Vector3 on_ball = around_z(std::sqrt(1 - z * z), k * kTurn, z);
    places.push_back({0.5 * shape.size[0] * on_ball[0], 0.5 * shape.size[1] * on_ball[1],
                      0.5 * shape.size[2] * on_ball[2]});
  }
  return places;
}

/// Returns the middles of the triangles' parts, so that the area is covered by about kTriedPlaces.
Places places_of(const MeshShape& mesh) {
  const auto corner = [&](int v, std::size_t c) {
    return mesh.scale * mesh.vertices[3 * std::size_t(v) + c];
  };
  const auto place = [&](const std::array<int, 3>& t, double u, double v) {
    Vector3 p{};
    for (std::size_t c = 0; c < 3; ++c)
      p[c] = corner(t[0], c) + u * (corner(t[1], c) - corner(t[0], c)) +
             v * (corner(t[2], c) - corner(t[0], c));
    return p;
  };
  const auto area = [&](const std::array<int, 3>& t) {
    const Vector3 a = place(t, 0, 0), b = place(t, 1, 0), c = place(t, 0, 1);
    const Vector3 across = cross(b - a, c - a);
    return 0.5 * std::sqrt(dot(across, across));
  };
  double whole = 0;
  for (const auto& t : mesh.triangles) whole += area(t);
  const std::size_t skip = std::max<std::size_t>(1, mesh.triangles.size() / kTriedPlaces);
  Places places;
  for (std::size_t k = 0; k < mesh.triangles.size(); k += skip) {
    const auto& t = mesh.triangles[k];
    const int n = std::clamp(int(std::ceil(std::sqrt(kTriedPlaces * area(t) / whole))), 1, 64);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n - i; ++j)
        places.push_back(place(t, (i + 1.0 / 3) / n, (j + 1.0 / 3) / n));
  }
  return places;
}

/// Returns the full widths of a shape along its axes [m]; zeros where it has no end.
std::array<double, 3> box_around(const Shape& shape) {
  const auto* const mesh = std::get_if<MeshShape>(&shape);
  if (mesh == nullptr) return widths(shape);
  std::array<double, 3> low{}, high{};
  for (std::size_t k = 0; k < mesh->vertices.size(); ++k) {
    const double x = mesh->scale * mesh->vertices[k];
    low[k % 3] = k < 3 ? x : std::min(low[k % 3], x);
    high[k % 3] = k < 3 ? x : std::max(high[k % 3], x);
  }
  return {high[0] - low[0], high[1] - low[1], high[2] - low[2]};
}

double width_of(const Shape& shape, ComparedWidth compared) {
  std::array<double, 3> width = box_around(shape);
  std::ranges::sort(width);
  return width[compared == ComparedWidth::second ? 1 : 0];
}

/// Returns where the middle of a link's body is at rest, in the world.
Vector3 rest_place(const Scene& scene, const LinkDescription& link) {
  Vector3 place = link.body.pose.position;
  for (const LinkDescription* l = &link;; l = &scene.links[std::size_t(l->parent)]) {
    place = outer_point(l->joint.pose, place);
    if (l->parent < 0) return place;
  }
}

/// Whether two equal cuboids, one above the other at rest, whose largest faces lie on each other
/// may touch with fewer than two rows of points.
bool rims_alone(const Scene& scene, const LinkDescription& points, const LinkDescription& touched) {
  constexpr double kAbove = 0.9;  // |cos| of the angle between their middles and gravity
  const auto* const one = std::get_if<CuboidShape>(&points.body.shape);
  const auto* const two = std::get_if<CuboidShape>(&touched.body.shape);
  if (one == nullptr || two == nullptr) return false;
  const Vector3 apart = rest_place(scene, points) - rest_place(scene, touched);
  if (!(std::abs(dot(apart, scene.gravity)) >
        kAbove * std::sqrt(dot(apart, apart) * dot(scene.gravity, scene.gravity))))
    return false;
  const std::array<int, 3>& n = one->contact_resolution;
  // Corners alone meet a cuboid face by face (kernels/step/faces.hpp).
  if (std::ranges::max(n) == 2) return false;
  const double thin = std::ranges::min(one->size);
  bool few = false;
  for (std::size_t k = 0; k < 3; ++k) {
    if (std::abs(one->size[k] - two->size[k]) > 2e-3 * one->size[k]) return false;
    const bool thickness = one->size[k] == thin && thin < 0.5 * std::ranges::max(one->size);
    few = few || (!thickness && n[k] < 4);
  }
  return few;
}

/// Whether a contact can ever have a force.
bool may_push(const Scene& scene, const PairContactDescription& c) {
  return c.coefficients.kn != 0 || c.coefficients.damping != 0 ||
         std::ranges::any_of(scene.randomizations, [&](const RandomizationDescription& r) {
           return r.number.owner == NumberOwner::contact && r.number.name == c.general_body &&
                  r.number.second_name == c.primitive_body;
         });
}

}  // namespace

double contact_point_gap(const Shape& shape) {
  if (const auto* const cuboid = std::get_if<CuboidShape>(&shape)) {
    double pitch = 0;
    for (std::size_t k = 0; k < 3; ++k)
      pitch = std::max(pitch, cuboid->size[k] / (cuboid->contact_resolution[k] - 1));
    return pitch;
  }
  const Places places = std::visit(
      [](const auto& s) {
        if constexpr (requires { places_of(s); })
          return places_of(s);
        else
          return Places{};
      },
      shape);
  if (places.empty()) return 0;
  const std::vector<double> points = contact_points(shape);
  double most = 0;
  for (const Vector3& place : places) {
    double nearest = HUGE_VAL;
    for (std::size_t k = 0; k < points.size() && nearest > most; k += 3) {
      const double x = points[k] - place[0], y = points[k + 1] - place[1],
                   z = points[k + 2] - place[2];
      nearest = std::min(nearest, x * x + y * y + z * z);
    }
    most = std::max(most, nearest);
  }
  return 2 * std::sqrt(most);
}

std::vector<CoarseContact> coarse_contacts(const Scene& scene, ComparedWidth compared) {
  std::vector<CoarseContact> found;
  std::map<const LinkDescription*, double> gaps;
  for (std::size_t k = 0; k < scene.pair_contacts.size(); ++k) {
    const PairContactDescription& c = scene.pair_contacts[k];
    const LinkDescription *const one = link_with(scene, c.general_body), *const two = link_with(
                                                                             scene,
                                                                             c.primitive_body);
    if (one == nullptr || two == nullptr || !may_push(scene, c)) continue;
    if (!c.points.empty() && !c.per_area()) continue;
    const Shape &points = one->body.shape, &touched = two->body.shape;
    const double width = width_of(touched, compared);
    if (width == 0) continue;
    if (c.per_area()) {
      if (c.spacing >= width * (1 - kAsWide)) found.push_back({k, c.spacing, width, false});
      continue;
    }
    const auto [place, is_new] = gaps.try_emplace(one, 0.0);
    if (is_new) place->second = contact_point_gap(points);
    const double gap = place->second;
    if (gap == 0) continue;
    const bool fits = gap >= width * (1 - kAsWide);
    if (fits || rims_alone(scene, *one, *two)) found.push_back({k, gap, width, !fits});
  }
  const auto other_way_is_fine = [&](const CoarseContact& coarse) {
    const PairContactDescription& c = scene.pair_contacts[coarse.contact];
    for (std::size_t k = 0; k < scene.pair_contacts.size(); ++k) {
      const PairContactDescription& other = scene.pair_contacts[k];
      if (other.general_body == c.primitive_body && other.primitive_body == c.general_body &&
          std::ranges::none_of(found, [&](const CoarseContact& f) { return f.contact == k; }))
        return true;
    }
    return false;
  };
  std::vector<CoarseContact> both;
  std::ranges::remove_copy_if(found, std::back_inserter(both), other_way_is_fine);
  return both;
}

std::vector<std::string> coarse_contact_lines(const Scene& scene) {
  constexpr std::size_t kMostLines = 5;
  std::vector<CoarseContact> found = coarse_contacts(scene, ComparedWidth::second);
  std::erase_if(found, [&](const CoarseContact& c) {  // those that surface_contact.cpp warns of
    return scene.pair_contacts[c.contact].per_area();
  });
  std::vector<std::string> lines;
  for (const CoarseContact& coarse : found) {
    if (lines.size() == kMostLines) {
      lines.push_back(fmt::format("{}{} more contacts have such points",
                                  scene.path.empty() ? "" : scene.path + ": ",
                                  found.size() - kMostLines));
      break;
    }
    const PairContactDescription& c = scene.pair_contacts[coarse.contact];
    const Shape& points = link_with(scene, c.general_body)->body.shape;
    const bool ball = is_ball(link_with(scene, c.primitive_body)->body.shape),
               mesh = std::holds_alternative<MeshShape>(points);
    // A cylinder has no points on its side, however many there are on its ends. A sphere does not
    // touch a mesh.
    const std::string finer =
        mesh ? "a smaller 'pitch' or larger 'count'"
        : std::holds_alternative<CylinderShape>(points)
            ? ""
            : fmt::format("a finer {}", row_of(points).counts.front().attribute);
    const std::string other_way =
        ball && mesh ? ""
        : ball       ? "the two bodies swapped"
                     : "the same contact the other way round as well, with near enough points";
    const std::string both = finer.empty() || other_way.empty() ? "" : ", or ";
    if (coarse.rims) {
      lines.push_back(fmt::format(
          "{}<general_primitive_contact>: '{}' and '{}' are equal, and '{}' has fewer than 4 "
          "points "
          "along an edge: where the two lie on each other, those in the rims may miss the face, so "
          "it can come out from under them; expected 4 or more in general_contact_resolution",
          c.source.prefix(), c.general_body, c.primitive_body, c.general_body));
      continue;
    }
    lines.push_back(fmt::format(
        "{}<general_primitive_contact>: contact points of '{}' are up to {:.3g} m apart, and '{}' "
        "is {:.3g} m across, so it can come between them, or out from under them, unnoticed; "
        "expected {}",
        c.source.prefix(), c.general_body, coarse.gap, c.primitive_body, coarse.width,
        finer + both + other_way + (finer.empty() && other_way.empty() ? "" : ", or ") +
            "<surface_contact>, in which whole surfaces touch"));
  }
  return lines;
}

namespace {

/// How far the corners of a round body stand out, and how many points along `attribute` would do.
struct Polygon {
  double corners = 0;  ///< [m]; 0: the body is not round, or touches with its surface
  int points = 0;
  bool around = false;  ///< the points are those of a ring
  double enough = 0;
  const char* attribute = "";
};
/// `depth`: how far the body sinks in [m].
Polygon polygon_of(const Shape& shape, double depth) {
  Polygon p;
  if (const auto* const ellipsoid = std::get_if<EllipsoidShape>(&shape)) {
    const double gap = contact_point_gap(shape);
    p = {gap * gap / (4 * std::ranges::max(ellipsoid->size)), ellipsoid->contact_count, false, 0,
         "general_contact_resolution"};
    p.enough = p.points * p.corners / depth;
    return p;
  }
  double radius = 0;
  if (const auto* const cylinder = std::get_if<CylinderShape>(&shape)) {
    radius = cylinder->radius, p.points = cylinder->contact_angles;
    p.attribute = "general_contact_angle_resolution";
  } else if (const auto* const capsule = std::get_if<CapsuleShape>(&shape)) {
    radius = capsule->radius, p.points = capsule->contact_angles;
    p.attribute = "second number of general_contact_resolution";
  } else {
    return p;
  }
  p.around = true;
  p.corners = radius * (1 - std::cos(std::numbers::pi / p.points));
  p.enough = std::numbers::pi / std::acos(1 - std::min(depth / radius, 1.0));
  return p;
}

/// Whether a body may roll under gravity: it moves freely, and its z axis does not stand.
bool may_roll(const Scene& scene, const LinkDescription& link) {
  constexpr double kUpright = 0.9;  // |cos| of the angle between axis and gravity
  const int mover = moving_link(scene, static_cast<int>(&link - scene.links.data()));
  if (mover < 0) return false;
  const JointType type = scene.links[std::size_t(mover)].joint.type;
  if (type != JointType::free && type != JointType::free2d) return false;
  if (std::holds_alternative<EllipsoidShape>(link.body.shape)) return true;
  Vector3 up = outer_direction(link.body.pose, {0, 0, 1});
  for (const LinkDescription* l = &link;; l = &scene.links[std::size_t(l->parent)]) {
    up = outer_direction(l->joint.pose, up);
    if (l->parent < 0) break;
  }
  return std::abs(dot(up, unit(scene.gravity))) < kUpright;
}

}  // namespace

std::vector<std::string> polygonal_rolling_lines(const Scene& scene) {
  std::vector<std::string> lines;
  const double gravity = std::sqrt(dot(scene.gravity, scene.gravity));
  if (!(gravity > 0)) return lines;
  const auto add = [&](const auto& contact, const char* element, const std::string& body,
                       const std::string& on) {
    const LinkDescription* const link = link_with(scene, body);
    if (link == nullptr || !(contact.coefficients.kn > 0) || !may_roll(scene, *link)) return;
    const Shape& shape = link->body.shape;
    const double mass = mass_properties(shape, link->body.density).mass,
                 depth = mass * gravity / (2 * contact.coefficients.kn);
    const Polygon p = polygon_of(shape, depth);
    if (p.corners <= depth) return;
    lines.push_back(fmt::format(
        "{}<{}>: '{}' touches {} with {} points{}, so it rolls over a polygon whose corners stand "
        "out by {:.2g} m, and it sinks in by {:.2g} m; to roll as a round body it needs a {} of "
        "{:.0f} or more, or <surface_contact>, in which whole surfaces touch",
        contact.source.prefix(), element, body, on, p.points, p.around ? " around" : "", p.corners,
        depth, p.attribute, std::ceil(p.enough)));
  };
  for (const GroundContactDescription& c : scene.ground_contacts)
    add(c, "ground_contact", c.body, "the ground");
  for (const PairContactDescription& c : scene.pair_contacts) {
    const LinkDescription* const on = link_with(scene, c.primitive_body);
    if (on != nullptr && c.points.empty() &&
        moving_link(scene, static_cast<int>(on - scene.links.data())) < 0 &&
        (std::holds_alternative<CuboidShape>(on->body.shape) ||
         std::holds_alternative<PlaneShape>(on->body.shape)))
      add(c, "general_primitive_contact", c.general_body, "'" + c.primitive_body + "'");
  }
  return lines;
}

}  // namespace tangere
