// SPDX-License-Identifier: Apache-2.0
// A tree is what hangs on one joint of the world. Bodies that stand in the world are in none.
#include "engine/model/gravity_shares.hpp"

#include <fmt/format.h>

namespace tangere {

void compile_gravity_shares(CompiledModel& m) {
  std::vector<int> root(m.links.size());
  for (std::size_t i = 0; i < m.links.size(); ++i)
    root[i] = m.links[i].parent < 0 ? static_cast<int>(i) : root[std::size_t(m.links[i].parent)];
  std::vector<const BodyDescription*> first(m.links.size());  // by root
  for (std::size_t k = 0; k < m.bodies.size(); ++k) {
    const CompiledBody& body = m.bodies[k];
    if (body.link < 0 || !(body.mass > 0)) continue;
    const BodyDescription& own = m.scene.links[k].body;
    const BodyDescription*& other = first[std::size_t(root[std::size_t(body.link)])];
    if (other == nullptr) other = &own;
    if (own.gravity_share != other->gravity_share)
      throw InputError(fmt::format(
          "{}body '{}': gravity_share=\"{}\", and \"{}\" of body '{}', which moves in the same "
          "tree of joints; expected one share",
          own.source.prefix(), own.name, own.gravity_share, other->gravity_share, other->name));
  }
  for (std::size_t i = 0; i < m.links.size(); ++i)
    if (const BodyDescription* const body = first[std::size_t(root[i])])
      m.links[i].gravity_share = body->gravity_share;
}

}  // namespace tangere
