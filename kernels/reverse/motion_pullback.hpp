// SPDX-License-Identifier: Apache-2.0
// Turns cotangents of link poses and twists into those of q and v (docs/gradients.md).
//
// A link's displacement δ (right, body axes) and twist V depend on joint i above it by
// ∂δ/∂q_i = X S_i, ∂V/∂q_i = X Ψ̇_i, ∂V/∂v_i = X S_i, with Ψ̇ = V_p × S. So δ̄ and V̄ travel up the
// tree as wrenches, and
//   q̄_i = Sᵀ δ̄ + Ψ̇ᵀ V̄ = Sᵀ (δ̄ - V_p ×* V̄);   v̄_i = Sᵀ V̄
// A move of the link's place is one along three more dofs that slide.
#pragma once

#include "kernels/step/link_poses.hpp"

namespace tangere::kernels {

/// What one link keeps between the sweeps.
template <class N>
struct LinkMotion {
  Frame<N> local;
  Vec6<N> Vp, V;
};

/// Adds to q̄ and v̄, (nv) each, and to `places`, (n_links, 3) of Link::frame.p, or null. Overwrites
/// `links`, (n_links). `scratch`: (n_links). The state is that of link_poses().
template <class N>
void pull_back_links(const ModelView& model, const StageArgs<N>& a, LinkMotion<N>* scratch,
                     MotionCotangent<N>* links, N* q_bar, N* v_bar, N* places) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N> one;
    Vec6<N> rate, unused;
    joint_motion(link, a, one, rate, unused);
    LinkMotion<N>& o = scratch[i];
    o.local = one.local;
    o.Vp = link.parent < 0 ? zero6<N>() : motion_to_child(link, o.local, scratch[link.parent].V);
    o.V = o.Vp + rate;
  }
  for (int i = model.n_links - 1; i >= 0; --i) {
    const Link& link = model.links[i];
    const LinkMotion<N>& o = scratch[i];
    const MotionCotangent<N>& c = links[i];
    const Vec6<N> q_wrench = c.pose - cross_wrench(o.Vp, c.twist);
    with_kind(link.kind, [&]<JointKind K>() {
      for (int k = 0; k < dofs(K); ++k) {
        q_bar[link.v + k] += project<K>(link, k, q_wrench);
        v_bar[link.v + k] += project<K>(link, k, c.twist);
      }
    });
    if (places != nullptr) {
      const Vec3<N> moved = o.local.R * q_wrench.l;
      N* const place = places + kPlaceNumbers * i;
      place[0] += moved.x, place[1] += moved.y, place[2] += moved.z;
    }
    if (link.parent < 0) continue;
    links[link.parent].pose += wrench_to_parent(link, o.local, c.pose);
    links[link.parent].twist += wrench_to_parent(link, o.local, c.twist);
  }
}

}  // namespace tangere::kernels
