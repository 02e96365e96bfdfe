// SPDX-License-Identifier: Apache-2.0
// Evaluates the signed distance of the touched shape at every contact point.
#include "engine/sense/start_overlaps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/frames.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/sense/point_depths.hpp"
#include "engine/step/batch.hpp"
#include "kernels/contact/distance.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

using kernels::Frame;
using kernels::Vec3;

namespace {

constexpr double kDeep = 0.1;  // share of the points' extent

std::string message(const ContactInfo& contact, double depth) {
  return fmt::format(
      "'{}' starts {:.3g} m inside '{}'; expected bodies that start apart or just touch",
      contact.first, depth, contact.second);
}

}  // namespace

std::vector<std::string> start_overlaps(const Model& model) {
  const CompiledModel& m = compiled(model);
  const Batch batch(model, 1, 0);
  PadReader reader(model);
  reader.move(batch, 0, 0);
  std::vector<std::string> found;
  for (std::size_t k = 0; k < m.pairs.size(); ++k) {
    const kernels::PairContact& pair = m.pairs[k];
    const double depth = pair_depths(pair, reader, 0, 0, batch.block(0)).deepest;
    if (depth > kDeep * pair.extent && pair.extent > 0)
      found.push_back(message(model.contacts()[k], depth));
  }
  for (std::size_t g = 0; g < m.grounds.size(); ++g) {
    const kernels::GroundContact& ground = m.grounds[g];
    const double depth = ground_depths(ground, m.view, reader, 0, 0).deepest;
    const double extent = ground.radius > 0 ? ground.radius : ground.extent;
    if (depth > kDeep * extent && extent > 0)
      found.push_back(message(model.contacts()[m.pairs.size() + g], depth));
  }
  return found;
}

std::vector<std::string> sensors_inside(const Model& model) {
  const CompiledModel& m = compiled(model);
  const Batch batch(model, 1, 0);
  PadReader reader(model);
  reader.move(batch, 0, 0);
  const auto pose = [&](const CompiledBody& body) {
    return compose(reader.link(body.link, 0, 0).world, body.frame);
  };
  const auto root = [&](int body) {
    while (m.scene.links[std::size_t(body)].parent >= 0)
      body = m.scene.links[std::size_t(body)].parent;
    return body;
  };
  std::vector<std::string> found;
  for (const CompiledSensor& sensor : m.sensors) {
    const TactileDescription& d = m.scene.sensors[std::size_t(sensor.number)];
    const std::vector<TactilePoint> points = tactile_points(d);
    const Frame<double> own = pose(m.bodies[std::size_t(sensor.body)]);
    for (const int target : sensor.targets) {
      const CompiledBody& body = m.bodies[std::size_t(target)];
      const Frame<double> shape = relative(pose(body), own);
      const Vec3<double> size =
          kernels::load_vector<double>(body.size, body.size_row, batch.block(0), 0);
      std::size_t inside = 0;
      double depth = 0, sum = 0;
      kernels::with_distance<double>(
          body.shape, size,
          [&](const auto& of) {
            for (const TactilePoint& p : points) {
              const double at = distance_at(of, shape.R * vec3_of(p.position) + shape.p).d;
              if (!(at < 0)) continue;
              ++inside;
              depth = std::max(depth, -at);
              sum -= at * p.factors[0];
            }
          },
          body.grid);
      const bool one_tree = root(sensor.body) == root(target);
      if (inside == 0 || (!one_tree && depth <= kDeep * sensor.reach)) continue;
      const std::string& name = model.body_names()[std::size_t(target)];
      found.push_back(fmt::format(
          "sensor '{}' starts with {} of {} points inside '{}', up to {:.3g} m deep, where they "
          "read {:.3g} N; expected a sensor that starts outside, or ignores=\"{}\"",
          d.name, inside, points.size(), name, depth, d.coefficients.kn * sum, name));
    }
  }
  return found;
}

std::vector<std::string> unchecked_overlaps(const Model& model) {
  const CompiledModel& m = compiled(model);
  std::vector<std::string> found;
  for (const auto& [one, two] : m.coarse_pairs)
    for (const int b : {one, two}) {
      const Shape& shape = m.scene.links[std::size_t(b)].body.shape;
      const bool mesh = std::holds_alternative<MeshShape>(shape);
      if (mesh ? m.bodies[std::size_t(b)].inscribed > 0 : has_distance(shape)) continue;
      found.push_back(
          fmt::format("'{}' and '{}' are not checked for overlaps between their contact points, "
                      "because '{}' {}",
                      model.body_names()[std::size_t(one)], model.body_names()[std::size_t(two)],
                      model.body_names()[std::size_t(b)],
                      mesh ? "is thinner than a cell of its distance" : "has no distance"));
    }
  return found;
}

std::vector<std::string> rounded_places(const Model& model) {
  constexpr double kShare = 1e-9;
  const CompiledModel& m = compiled(model);
  const Batch batch(model, 1, 0);
  PadReader reader(model);
  reader.move(batch, 0, 0);
  std::vector<std::string> found;
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const CompiledBody& body = m.bodies[b];
    const Vec3<double> p = compose(reader.link(body.link, 0, 0).world, body.frame).p;
    const double far = std::sqrt(std::max(dot(p, p), dot(m.origin, m.origin))),
                 rounded = far * std::numeric_limits<double>::epsilon(), size = body.extent;
    if (rounded > kShare * size && size > 0)
      found.push_back(fmt::format(
          "'{}' starts {:.3g} m away, where positions are rounded to {:.2g} m; expected a scene "
          "nearer to the world's origin",
          model.body_names()[b], far, rounded));
  }
  return found;
}

std::vector<std::string> paths_through_surfaces(const Model& model) {
  const CompiledModel& m = compiled(model);
  std::vector<std::string> found;
  if (m.transmissions.empty()) return found;
  const Batch batch(model, 1, 0);
  PadReader reader(model);
  reader.move(batch, 0, 0);
  const auto placed = [&](int link, const Vec3<double>& at) {
    const kernels::Frame<double> world = reader.link(link, 0, 0).world;
    return world.R * at + world.p;
  };
  for (std::size_t t = 0; t < m.transmissions.size(); ++t) {
    const kernels::Transmission& of = m.transmissions[t];
    for (int k = of.first_piece; k < of.first_piece + of.pieces; ++k) {
      const kernels::TransmissionPiece& piece = m.transmission_pieces[std::size_t(k)];
      const bool cylinder = piece.kind == kernels::PieceKind::cylinder;
      if (!cylinder && piece.kind != kernels::PieceKind::sphere) continue;
      const Vec3<double> axis = reader.link(piece.round, 0, 0).world.R * piece.axis;
      double least = piece.radius;
      for (const auto& [link, at] : {std::pair{piece.first, piece.first_point},
                                     std::pair{piece.second, piece.second_point}}) {
        Vec3<double> arm = placed(link, at) - placed(piece.round, piece.centre);
        if (cylinder) arm -= dot(arm, axis) * axis;
        least = std::min(least, std::sqrt(dot(arm, arm)));
      }
      if (least < piece.radius)
        found.push_back(fmt::format(
            "the path of joint '{}' starts with a point {:.3g} m from the middle of a surface of "
            "radius {:.3g} m, so it goes straight through the surface; expected points outside",
            model.scene().transmissions[t].joint, least, piece.radius));
    }
  }
  return found;
}

std::vector<std::string> transmissions_outside_limits(const Model& model) {
  const CompiledModel& m = compiled(model);
  std::vector<std::string> found;
  if (m.transmissions.empty()) return found;
  constexpr double kRounding = 1e-9;  // of the limits
  const Batch batch(model, 1, 0);
  std::vector<double> q(std::size_t(model.nq()));
  batch.get_q(0, q);
  for (std::size_t k = 0; k < m.joints.size(); ++k) {
    const JointDescription& joint = m.scene.links[k].joint;
    if (!joint.limits || !(joint.limit_stiffness > 0)) continue;
    if (!is_transmission(m.scene, joint)) continue;
    const double at = q[std::size_t(m.joints[k].q)];
    const auto [low, high] = *joint.limits;
    const double slack = kRounding * (std::abs(low) + std::abs(high));
    if (at >= low - slack && at <= high + slack) continue;
    found.push_back(fmt::format(
        "{}the transmission of joint '{}' starts at {:.4g} m, outside its limits {:.4g} "
        "{:.4g}; the springs of limits push from the first step on; if it is not meant to start "
        "taut, expected another path or state, or other limits",
        joint.source.prefix(), joint.name, at, low, high));
  }
  return found;
}

}  // namespace tangere
