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
#include "engine/sense/point_depths.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

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
