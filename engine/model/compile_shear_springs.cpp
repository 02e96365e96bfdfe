// SPDX-License-Identifier: Apache-2.0
// Every contact with shear springs gets a range of point numbers. The shear state of an environment
// is sorted by them.
#include "engine/model/compile_shear_springs.hpp"

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/model/contact_tiles.hpp"
#include "engine/model/group_contacts.hpp"
#include "engine/scene/frames.hpp"
#include "kernels/step/arguments.hpp"

namespace tangere {

using kernels::Vec3;

namespace {

/// Keeps points (n, 3) as rows of coordinates that vectors can read.
void keep_places(CompiledModel& m, kernels::ShearSpringContact& of) {
  constexpr int kLanes = kernels::kGroup;
  const int n = of.contact.n_points;
  of.stride = (n + kLanes - 1) / kLanes * kLanes;
  AlignedVector<double> rows(std::size_t(3 * of.stride), kernels::kFarAway);
  for (int k = 0; k < n; ++k)
    for (int c = 0; c < 3; ++c) rows[std::size_t(c * of.stride + k)] = of.contact.points[3 * k + c];
  m.tile_storage.push_back(std::move(rows));
  of.places = m.tile_storage.back().data();
}

int add(CompiledModel& m, kernels::ShearSpringContact of) {
  of.first = m.shear_spring_points;
  if (of.sensor < 0) m.taped_points += of.contact.n_points;
  m.shear_spring_points += m.shear_rows(of);
  m.shear_springs.push_back(of);
  return static_cast<int>(m.shear_springs.size()) - 1;
}

void add_grounds(CompiledModel& m) {
  for (int k = 0; k < m.view.n_grounds; ++k) {
    kernels::GroundContact& g = m.grounds[std::size_t(k)];
    if (!has_shear_spring(g.parameters)) continue;
    kernels::ShearSpringContact of;
    of.number = m.view.rows.ground(k);
    of.ground = true;
    of.grounded = k;
    of.radius = g.radius;
    of.radius_row = g.radius_row;
    of.contact = {};
    of.contact.link1 = g.link;
    of.contact.link2 = -1;
    of.contact.frame2 = ground_frame(m.view.ground_point, m.view.ground_normal);
    of.contact.shape = PrimitiveShape::plane;
    of.contact.law = g.law;
    of.contact.ramp = g.ramp;
    of.contact.parameters = g.parameters;
    of.contact.points = g.points;
    of.contact.n_points = g.n_points;
    of.contact.body1 = g.body;
    of.contact.body2 = -1;
    keep_places(m, of);
    g.memory = add(m, of);
    g.first_anchor = m.ground_anchors;
    m.ground_anchors += g.n_points;
  }
}

/// Points of a sensor in field order, link axes (n, 3), with their axes (n, 9) and factors
/// (n, kPointCoefficients).
struct PadPoints {
  std::vector<double> places, axes, factors;
};

PadPoints points_of(const TactileDescription& d, const kernels::Frame<double>& body) {
  PadPoints out;
  const auto put = [](std::vector<double>& to, const Vec3<double>& x) {
    to.insert(to.end(), {x.x, x.y, x.z});
  };
  for (const TactilePoint& p : tactile_points(d)) {
    put(out.places, body.R * vec3_of(p.position) + body.p);
    for (const Vec3<double>& row : {vec3_of(p.axis0), vec3_of(p.axis1), -vec3_of(p.normal)})
      put(out.axes, body.R * row);
    out.factors.insert(out.factors.end(), p.factors.begin(), p.factors.end());
  }
  return out;
}

/// Puts the points of an elastic sensor in the order of tiles. Returns the tiles' bounds.
std::vector<double> order_points(CompiledSensor& s, PadPoints& points) {
  std::vector<double> tiles = sort_into_tiles(points.places, kernels::kContactTile, &s.in_field);
  bool own = false;
  for (const int from : s.in_field) {
    const auto copy = [from](const std::vector<double>& all, int width, std::vector<double>& to) {
      to.insert(to.end(), all.begin() + width * from, all.begin() + width * (from + 1));
    };
    copy(points.axes, 9, s.point_axes);
    copy(points.factors, kPointCoefficients, s.point_factors);
  }
  for (const double factor : s.point_factors) own = own || factor != 1;
  if (!own) s.point_factors.clear();
  return tiles;
}

/// Adds the sensors that keep anchors, or the others.
void add_sensors(CompiledModel& m, bool keep_anchors) {
  for (CompiledSensor& s : m.sensors) {
    const TactileDescription& d = m.scene.sensors[std::size_t(s.number)];
    if (!has_shear_spring(s.parameters) || d.shear_at_readings != keep_anchors) continue;
    if (s.past_states() > 0)
      throw InputError(d.source.prefix() + "tactile sensor '" + d.name +
                       "' has ks and low_pass or delay; expected one of them: friction does not "
                       "remember further back than the last state");
    s.elastic = true;
    if (keep_anchors) s.shear_interval = d.every;
    PadPoints points = points_of(d, m.bodies[std::size_t(s.body)].frame);
    const std::vector<double> tiles = order_points(s, points);
    m.point_storage.push_back(std::move(points.places));
    kernels::PairContact contact{};
    contact.link1 = s.link;
    contact.law = s.law;
    contact.parameters = s.parameters;
    contact.points = m.point_storage.back().data();
    contact.n_points = s.points();
    contact.n_tiles = static_cast<int>(tiles.size() / 4);
    contact.body1 = s.body;
    bound(contact.points, contact.n_points, contact.middle, contact.extent);
    lay_out_tiles(m, contact, tiles);
    m.taped_points += s.points() * (s.shear_interval > 0 ? 2 : 1);
    for (const int target : s.targets) {
      const CompiledBody& body = m.bodies[std::size_t(target)];
      kernels::ShearSpringContact of;
      of.contact = contact;
      of.contact.link2 = body.link;
      of.contact.frame2 = body.frame;
      of.contact.shape = body.shape;
      of.contact.size = body.size;
      of.contact.size_row = body.size_row;
      of.contact.grid = body.grid;
      of.contact.body2 = target;
      of.sensor = s.number;
      of.number = m.view.rows.sensor(s.number);
      add(m, of);
    }
  }
}

}  // namespace

kernels::Frame<double> ground_frame(const Vec3<double>& point, const Vec3<double>& normal) {
  const Vec3<double> aside =
      std::abs(normal.x) < 0.6 ? Vec3<double>{1, 0, 0} : Vec3<double>{0, 1, 0};
  Vec3<double> x = aside - dot(aside, normal) * normal;
  x = (1 / std::sqrt(dot(x, x))) * x;
  const Vec3<double> y = cross(normal, x);
  return {{{{x.x, y.x, normal.x}, {x.y, y.y, normal.y}, {x.z, y.z, normal.z}}}, point};
}

void compile_shear_springs(CompiledModel& m) {
  add_sensors(m, true);
  m.kept_points = m.shear_spring_points;
  for (std::size_t k = 0; k < m.pairs.size(); ++k) {
    kernels::PairContact& pair = m.pairs[k];
    if (!has_shear_spring(pair.parameters)) continue;
    if (pair.ball_radius > 0) {
      const PairContactDescription& d = m.scene.pair_contacts[k];
      throw InputError(d.source.prefix() + "ks of the sphere '" + d.general_body + "' against '" +
                       d.primitive_body +
                       "': a sphere that touches with its surface does not remember; expected 0, "
                       "or the two bodies swapped");
    }
    kernels::ShearSpringContact of;
    of.contact = pair;
    of.pair = static_cast<int>(k);
    of.number = m.view.rows.pair(of.pair);
    pair.memory = add(m, of);
  }
  add_grounds(m);
  add_sensors(m, false);
  m.view.n_shear_springs = static_cast<int>(m.shear_springs.size());
  m.view.memories = m.shear_springs.data();
}

}  // namespace tangere
