// SPDX-License-Identifier: Apache-2.0
// A tree has the name of its first body in the scene's order.
#include "engine/step/sleeping_trees.hpp"

#include <algorithm>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model_part.hpp"

namespace tangere {

std::vector<std::string> sleeping_trees(const Model& model) {
  const CompiledModel& m = compiled(model);
  const std::vector<int> tree = trees_of(m);
  std::vector<std::string> names(tree.empty() ? 0 : std::size_t(std::ranges::max(tree)) + 1);
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    if (m.bodies[b].link < 0) continue;
    std::string& name = names[std::size_t(tree[std::size_t(m.bodies[b].link)])];
    if (name.empty()) name = model.body_names()[b];
  }
  return names;
}

}  // namespace tangere
