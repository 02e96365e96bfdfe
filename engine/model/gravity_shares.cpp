// SPDX-License-Identifier: Apache-2.0
// The share of a link is that of its bodies with mass. A link without mass has that of its parent.
#include "engine/model/gravity_shares.hpp"

#include <fmt/format.h>

namespace tangere {

void compile_gravity_shares(CompiledModel& m) {
  std::vector<const BodyDescription*> first(m.links.size());
  for (std::size_t k = 0; k < m.bodies.size(); ++k) {
    const CompiledBody& body = m.bodies[k];
    if (body.link < 0 || !(body.mass > 0)) continue;
    const BodyDescription& own = m.scene.links[k].body;
    const BodyDescription*& other = first[std::size_t(body.link)];
    if (other == nullptr) other = &own;
    if (own.gravity_share != other->gravity_share)
      throw InputError(fmt::format(
          "{}body '{}': gravity_share=\"{}\", and \"{}\" of body '{}', which moves rigidly with "
          "it; "
          "expected one share",
          own.source.prefix(), own.name, own.gravity_share, other->gravity_share, other->name));
  }
  std::vector<double> base(m.links.size(), 1);  // of the root of each link's tree
  // A root without mass has the share of the first link of its tree that has one.
  for (std::size_t i = m.links.size(); i-- > 0;) {
    if (first[i] != nullptr) base[i] = first[i]->gravity_share;
    const int parent = m.links[i].parent;
    if (parent >= 0 && first[std::size_t(parent)] == nullptr) base[std::size_t(parent)] = base[i];
  }
  m.view.lifted = false;
  for (std::size_t i = 0; i < m.links.size(); ++i) {
    kernels::Link& link = m.links[i];
    const double own = base[i];
    if (link.parent >= 0) base[i] = base[std::size_t(link.parent)];
    link.gravity_share = own;
    link.lift = base[i] - own;
    m.view.lifted = m.view.lifted || link.lift != 0;
  }
}

}  // namespace tangere
