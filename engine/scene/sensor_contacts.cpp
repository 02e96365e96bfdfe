// SPDX-License-Identifier: Apache-2.0
// One pair for each sensed body, all with the sensor's coefficients.
#include "engine/scene/sensor_contacts.hpp"

#include <fmt/format.h>

#include "engine/base/error.hpp"
#include "engine/scene/sensed_bodies.hpp"

namespace tangere {
namespace {

/// Refuses feedback of a sensor that touches a body whose own sensor touches the sensor's body.
void refuse_facing(const Scene& scene, const TactileDescription& d, const std::string& touched) {
  for (const PairContactDescription& c : scene.pair_contacts)
    if (!c.sensor.empty() && c.general_body == touched && c.primitive_body == d.body)
      throw InputError(fmt::format(
          "{}<tactile> of '{}': feedback and {}<tactile> of '{}', which has feedback: both are "
          "contacts of '{}' and '{}', which would count twice; expected ignores=\"{}\" of '{}' or "
          "ignores=\"{}\" of '{}'",
          d.source.prefix(), d.name, c.source.prefix(), c.sensor, d.body, touched, touched, d.name,
          d.body, c.sensor));
}

}  // namespace

void add_sensor_contacts(Scene& scene, const TactileDescription& d) {
  PairContactDescription pair;
  for (const TactilePoint& p : tactile_points(d)) {
    if (p.factors != TactilePoint{}.factors)
      throw InputError(d.source.prefix() +
                       "<tactile>: feedback needs points with the sensor's own coefficients, and "
                       "this layout has factors of them");
    pair.points.insert(pair.points.end(), p.position.begin(), p.position.end());
  }
  pair.general_body = d.body;
  pair.sensor = d.name;
  pair.coefficients = d.coefficients;
  pair.law = d.law;
  pair.source = d.source;
  const std::vector<int> sensed = sensed_bodies(scene, d);
  for (const int other : sensed) {
    pair.primitive_body = scene.links[std::size_t(other)].body.name;
    refuse_facing(scene, d, pair.primitive_body);
    scene.pair_contacts.push_back(pair);
  }
  if (sensed.empty())
    throw InputError(fmt::format(
        "{}<tactile>: feedback of '{}' would touch nothing; expected a body with a distance that "
        "moves against '{}'",
        d.source.prefix(), d.name, d.body));
}

}  // namespace tangere
