// SPDX-License-Identifier: Apache-2.0
// Warns of sensors that read zero for ever, or forces that nothing exerts.
#include "io/scene/scene_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace tangere {
namespace {

/// Returns for each body the number of the body that it is rigidly joined to first, -1: the world.
std::vector<int> rigid_groups(const Scene& scene) {
  std::vector<int> group;
  for (std::size_t k = 0; k < scene.links.size(); ++k) {
    const LinkDescription& link = scene.links[k];
    const int above = link.parent < 0 ? -1 : group[std::size_t(link.parent)];
    group.push_back(link.joint.type == JointType::fixed ? above : static_cast<int>(k));
  }
  return group;
}

std::string listed(const std::set<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

}  // namespace

void warn_of_idle_sensors(const Scene& scene, const SceneNode& root) {
  const std::vector<int> group = rigid_groups(scene);
  const auto group_of = [&](const std::string& body) {
    for (std::size_t k = 0; k < scene.links.size(); ++k)
      if (scene.links[k].body.name == body) return group[k];
    return -1;
  };
  for (const TactileDescription& sensor : scene.sensors) {
    const int own = group_of(sensor.body);
    std::set<std::string> without;  // distance, and free to move against the sensor
    bool feels = false;
    for (std::size_t k = 0; k < scene.links.size(); ++k) {
      if (group[k] == own) continue;
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
