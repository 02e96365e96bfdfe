// SPDX-License-Identifier: Apache-2.0
// A stiffness per area is k_n times the points per area. Those are known for arrays, for the sides
// of cuboids and for caps of cylinders. Of other points they are estimated from the distances
// between them, and a warning takes a larger difference.
#include "io/scene/unlike_skins.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "engine/scene/shapes.hpp"

namespace tangere {
namespace {

constexpr double kUnlike = 30, kUnlikeByEstimate = 100;

/// Points per area of the face of a pad's body that a tactile array lies on [1/m²], or 0 where that
/// is not known: the sides of cuboids with axes along theirs, and caps of cylinders.
double points_on_face(const Shape& shape, const RectArray& array) {
  constexpr double kAlong = 0.99;
  std::array<bool, 3> in_face{};  // axes of the body that the array lies along
  for (const Vector3& axis : {array.axis0, array.axis1})
    for (std::size_t k = 0; k < 3; ++k) in_face[k] = in_face[k] || std::abs(axis[k]) > kAlong;
  if (std::count(in_face.begin(), in_face.end(), true) != 2) return 0;
  if (const auto* const cuboid = std::get_if<CuboidShape>(&shape)) {
    double points = 1, area = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!in_face[k]) continue;
      points *= cuboid->contact_resolution[k] - 1;
      area *= cuboid->size[k];
    }
    return points / area;
  }
  if (const auto* const cylinder = std::get_if<CylinderShape>(&shape)) {
    if (in_face[2]) return 0;
    const double points = 1 + double(cylinder->contact_rings) * cylinder->contact_angles;
    return points / (M_PI * cylinder->radius * cylinder->radius);
  }
  return 0;
}

/// Estimates how many of some points (n, 3) lie on an area [1/m²]: one on the square of the
/// distance to its nearest neighbour, the median over 64 points at most. 0: fewer than two points.
double points_by_distance(const std::vector<double>& points) {
  const std::size_t n = points.size() / 3, samples = std::min<std::size_t>(n, 64);
  if (n < 2) return 0;
  std::vector<double> areas;
  for (std::size_t i = 0; i < samples; ++i) {
    const double* const p = &points[3 * (i * n / samples)];
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < n; ++k) {
      const double* const q = &points[3 * k];
      const Vector3 way = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
      if (const double area = dot(way, way); area > 0) nearest = std::min(nearest, area);
    }
    areas.push_back(nearest);
  }
  std::nth_element(areas.begin(), areas.begin() + static_cast<long>(samples / 2), areas.end());
  return 1 / areas[samples / 2];  // 0 where all lie at one place
}

double points_of_sensor(const TactileDescription& d) {
  const RectArray& a = d.array;
  if (!d.points.empty()) {
    std::vector<double> points;
    for (const TactilePoint& p : d.points)
      points.insert(points.end(), p.position.begin(), p.position.end());
    return points_by_distance(points);
  }
  const Vector3 way = a.corner1 - a.corner0;
  const double area = std::abs(dot(way, a.axis0) * dot(way, a.axis1));
  return area > 0 ? (a.rows - 1) * (a.cols - 1) / area : 0;
}

const Shape* shape_of(const Scene& scene, const std::string& body) {
  const auto link = std::find_if(scene.links.begin(), scene.links.end(),
                                 [&](const auto& l) { return l.body.name == body; });
  return link == scene.links.end() ? nullptr : &link->body.shape;
}

/// Estimates for the contact points of bodies, made once for each body.
class Densities {
 public:
  /// Returns how many points lie on an area [1/m²]; 0: not known.
  double of(const std::string& body, const Shape& shape) {
    const auto [at, made] = found_.try_emplace(body, 0);
    if (const auto points = row_of(shape).points; made && points != nullptr)
      at->second = points_by_distance(points(shape));
    return at->second;
  }

 private:
  std::map<std::string, double> found_;
};

/// A contact's stiffness per area [N/m³].
struct Pressed {
  double stiffness;
  bool known;  ///< not an estimate
};
Pressed pressed_by(const TactileDescription& d, const PairContactDescription& c, bool own,
                   const Shape& shape, Densities& estimates) {
  if (c.per_area()) return {c.coefficients.kn, true};
  const double density = own && d.points.empty() ? points_on_face(shape, d.array) : 0;
  if (density > 0) return {c.coefficients.kn * density, true};
  return {c.coefficients.kn * estimates.of(c.general_body, shape), false};
}

/// The warning of a sensor and a contact of its body, or "".
std::string unlike(const Scene& scene, const TactileDescription& d, double sensed,
                   const PairContactDescription& c, Densities& estimates) {
  const bool own = c.general_body == d.body;
  const Shape* const shape = shape_of(scene, c.general_body);
  if ((!own && c.primitive_body != d.body) || shape == nullptr || c.second_half ||
      (!c.points.empty() && !c.per_area()))
    return "";
  const auto [pressed, known] = pressed_by(d, c, own, *shape, estimates);
  if (!(pressed > 0)) return "";
  const double share = sensed / pressed, most = known ? kUnlike : kUnlikeByEstimate;
  if (share < most && share > 1 / most) return "";
  return fmt::format(
      "{}<tactile>: kn of '{}' is {:.3g} N/m per mm² of skin, that of its contact with '{}' is "
      "{}{:.3g}, so the field shows {}{:.2g} times the force; expected about the same of both, as "
      "'tangere skin' gives them",
      d.source.prefix(), d.name, sensed * 1e-6, own ? c.primitive_body : c.general_body,
      known ? "" : "about ", pressed * 1e-6, known ? "" : "about ", share);
}

}  // namespace

void warn_of_unlike_skins(const Scene& scene, const SceneNode& root) {
  Densities estimates;
  for (const TactileDescription& d : scene.sensors) {
    const double sensed = d.coefficients.kn * points_of_sensor(d);
    if (!(sensed > 0) || (d.layer && d.layer->load_control)) continue;
    for (const PairContactDescription& c : scene.pair_contacts)
      if (const std::string text = unlike(scene, d, sensed, c, estimates); !text.empty()) {
        root.context().warnings.push_back(text);
        break;
      }
  }
}

}  // namespace tangere
