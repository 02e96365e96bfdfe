// SPDX-License-Identifier: Apache-2.0
// Looks at every contact point once, by the plain distance of the shape that it may touch.
#include "engine/sense/start_overlaps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/step/batch.hpp"
#include "kernels/contact/distance.hpp"

namespace tangere {

using kernels::Frame;
using kernels::Vec3;

namespace {

constexpr double kDeep = 0.1;  // share of the points' extent

/// Returns the largest depth of points (n, 3) in a shape posed in their axes [m].
double deepest(const kernels::PairContact& pair, const Vec3<double>& size,
               const Frame<double>& shape) {
  return kernels::with_distance<double>(
      pair.shape, size,
      [&](const auto& of) {
        double most = 0;
        for (int k = 0; k < pair.n_points; ++k) {
          const double* p = pair.points + 3 * k;
          const Vec3<double> at =
              transposed_times(shape.R, Vec3<double>{p[0], p[1], p[2]} - shape.p);
          most = std::max(most, pair.ball_radius - distance_at(of, at).d);
        }
        return most;
      },
      pair.grid);
}

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
  const auto pose = [&](int link) { return reader.link(link, 0, 0).world; };
  std::vector<std::string> found;
  for (std::size_t k = 0; k < m.pairs.size(); ++k) {
    const kernels::PairContact& pair = m.pairs[k];
    const Frame<double> shape = compose(relative(pose(pair.link1), pose(pair.link2)), pair.frame2);
    Vec3<double> size = pair.size;
    for (int c = 0; c < 3 && pair.size_row >= 0; ++c)
      (&size.x)[c] = *kernels::row_of(batch.block(0), pair.size_row + c, 0);
    const double depth = deepest(pair, size, shape);
    if (depth > kDeep * pair.extent && pair.extent > 0)
      found.push_back(message(model.contacts()[k], depth));
  }
  for (std::size_t g = 0; g < m.grounds.size(); ++g) {
    const kernels::GroundContact& ground = m.grounds[g];
    const Frame<double> body = pose(ground.link);
    double depth = 0;
    for (int k = 0; k < ground.n_points; ++k) {
      const double* p = ground.points + 3 * k;
      const Vec3<double> at = body.R * Vec3<double>{p[0], p[1], p[2]} + body.p;
      depth = std::max(depth, ground.radius - dot(m.view.ground_normal, at - m.view.ground_point));
    }
    const double extent = ground.radius > 0 ? ground.radius : ground.extent;
    if (depth > kDeep * extent && extent > 0)
      found.push_back(message(model.contacts()[m.pairs.size() + g], depth));
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

}  // namespace tangere
