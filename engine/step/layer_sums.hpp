// SPDX-License-Identifier: Apache-2.0
// Contacts of layers, lane by lane (engine/layer/layer_contact.hpp). Their sums are added to those
// of their links' other contacts.
#pragma once

#include "engine/layer/layer_contact.hpp"
#include "engine/step/detection.hpp"

namespace tangere {

/// Computes Stage::layer_sums of `lanes` at the poses of kinematics(), from the present candidates.
/// `derivatives`: not of the wrench alone. Returns the lanes in which a layer has no pressures;
/// their sums are not numbers.
template <int L>
LaneBits set_layer_sums(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes, bool derivatives);

/// Solves the contact of a pad with the bodies of a pair of links in one lane, at the motion that
/// set_layer_sums() found. Leaves it in w.layer_contact, and the pairs of its bodies in
/// w.layer_members.
template <int L>
void solve_layer(const CompiledModel& model, const kernels::KernelTable& table,
                 BasicWorkspace<L>& w, const kernels::LinkPair& links, int pad, int lane);

/// Calls f(links, pad) for every pad and pair of links that are not apart.
template <int L, class F>
void for_each_layer(const CompiledModel& model, const BasicWorkspace<L>& w, const F& f) {
  if (model.layer_pads.empty()) return;
  for_each_considered(model, w, [&](std::size_t g) {
    const kernels::LinkPair& links = model.link_pairs[g];
    if (links.layer < 0 || w.candidates->apart[g] != 0) return;
    for (int pad = 0; pad < static_cast<int>(model.layer_pads.size()); ++pad)
      for (int i = links.first; i < links.first + links.count; ++i)
        if (model.pairs[std::size_t(model.pair_order[std::size_t(i)])].layer_pad == pad) {
          f(links, pad);
          break;
        }
  });
}

}  // namespace tangere
