// SPDX-License-Identifier: Apache-2.0
// How two links move against each other, and what a wrench between them is on the dofs.
#pragma once

#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Returns link 2 in link 1. The world has its own frame. `pair`: a LinkPair or a Loop.
template <class Pair, class N>
Frame<N> link_pair_pose(const Pair& pair, const StageArgs<N>& a) {
  const Frame<N> origin = {diagonal(N(1.0)), zero3<N>()};
  const Frame<N>& w1 = pair.link1 < 0 ? origin : a.links[pair.link1].world;
  const Frame<N>& w2 = pair.link2 < 0 ? origin : a.links[pair.link2].world;
  return relative(w1, w2);
}

/// Computes relative pose and twist of two links. The world has no twist.
template <class Pair, class N>
void pair_motion(const Pair& pair, const StageArgs<N>& a, ContactScratch<N>& o) {
  o.link2_in_1 = link_pair_pose(pair, a);
  o.Z = pair.link2 < 0 ? zero6<N>() : motion_to_parent(o.link2_in_1, a.links[pair.link2].V);
  o.W = pair.link1 < 0 ? o.Z : o.Z - a.links[pair.link1].V;
}

/// Adds |generalised force| of one contact wrench on a link to the scale of every dof that moves
/// the link.
template <class N>
void add_force_scale(const ModelView& model, const StageArgs<N>& a, int link, Vec6<N> wrench) {
  for (int i = link; i >= 0; i = model.links[i].parent) {
    with_kind(model.links[i].kind, [&]<JointKind K>() {
      for (int k = 0; k < dofs(K); ++k)
        a.force_scale[model.links[i].v + k] += abs(project<K>(model.links[i], k, wrench));
    });
    if (model.links[i].parent >= 0)
      wrench = wrench_to_parent(model.links[i], a.links[i].local, wrench);
  }
}

}  // namespace tangere::kernels
