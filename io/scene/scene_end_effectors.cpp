// SPDX-License-Identifier: Apache-2.0
// Reads end effectors of a scene file.
#include <fmt/format.h>

#include <algorithm>

#include "io/scene/scene_sections.hpp"

namespace tangere {

void read_end_effectors(Scene& scene, const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    node.check();
    EndEffectorDescription d;
    d.source = node.source();
    find_joint(scene, node, "joint");
    d.joint = node.text("joint");
    d.name = node.text("name", "");
    for (const EndEffectorDescription& other : scene.end_effectors)
      if (!d.name.empty() && other.name == d.name)
        node.fail("endeffector name '" + d.name + "' is used twice");
    node.read(d);
    scene.end_effectors.push_back(std::move(d));
  }
}

void name_end_effectors(Scene& scene) {
  const auto taken = [&](const std::string& name) {
    return std::any_of(scene.end_effectors.begin(), scene.end_effectors.end(),
                       [&](const auto& v) { return v.name == name; });
  };
  for (std::size_t i = 0; i < scene.end_effectors.size(); ++i)
    for (std::size_t k = i; scene.end_effectors[i].name.empty(); ++k)
      if (const std::string name = fmt::format("endeffector{}", k); !taken(name))
        scene.end_effectors[i].name = name;
}

}  // namespace tangere
