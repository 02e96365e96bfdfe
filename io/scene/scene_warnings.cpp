// SPDX-License-Identifier: Apache-2.0
// Warns of sensors that read zero for ever, or forces that nothing exerts.
#include "io/scene/scene_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "io/scene/scene_sections.hpp"

namespace tangere {
namespace {

std::string listed(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

}  // namespace

void warn_of_idle_sensors(const Scene& scene, const SceneNode& root) {
  const auto group_of = [&](const std::string& body) {
    for (std::size_t k = 0; k < scene.links.size(); ++k)
      if (scene.links[k].body.name == body) return moving_link(scene, static_cast<int>(k));
    return -1;
  };
  for (const TactileDescription& sensor : scene.sensors) {
    const int own = group_of(sensor.body);
    std::set<std::string> without;  // distance, and free to move against the sensor
    bool feels = false;
    for (std::size_t k = 0; k < scene.links.size(); ++k) {
      if (moving_link(scene, static_cast<int>(k)) == own) continue;
      const BodyDescription& body = scene.links[k].body;
      feels = feels || has_distance(body.shape);
      if (!has_distance(body.shape)) without.insert(body.name);
    }
    const std::string of = fmt::format("{}<tactile>: sensor '{}' on body '{}' ",
                                       sensor.source.prefix(), sensor.name, sensor.body);
    if (!feels) {
      root.context().warnings.push_back(
          of + (without.empty() ? "can feel nothing: no other body moves against it"
                                : "can feel nothing: a sensor feels shapes with a distance, and " +
                                      listed(without) + " has none"));
      continue;
    }
    const auto touches = [&](const PairContactDescription& c) {
      return (group_of(c.general_body) == own) != (group_of(c.primitive_body) == own);
    };
    if (std::none_of(scene.pair_contacts.begin(), scene.pair_contacts.end(), touches))
      root.context().warnings.push_back(
          of +
          "reads forces that nothing exerts: no contact is declared between that body, or one "
          "that is rigidly joined to it, and another, so bodies pass through it");
  }
}

}  // namespace tangere
