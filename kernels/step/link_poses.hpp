// SPDX-License-Identifier: Apache-2.0
// World poses and twists of all links of eight environments, and those of a shape against a pad
// and of pairs of links.
#pragma once

#include "kernels/step/arguments.hpp"
#include "kernels/step/residual.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// Computes poses and body twists at (centre, r). With x = 0, c₀/h = 0 and 1/h = 1, the rates of a
/// stage are r itself.
template <class N>
void link_poses(const ModelView& model, const StageArgs<N>& a, LinkPose<N>* out) {
  LinkScratch<N> scratch;
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    Vec6<N> rate, unused;
    joint_motion(link, a, scratch, rate, unused);
    if (link.parent < 0) {
      out[i] = {scratch.local, rate};
    } else {
      const LinkPose<N>& parent = out[link.parent];
      out[i] = {compose(parent.world, scratch.local),
                motion_to_child(scratch.local, parent.V) + rate};
    }
  }
}

/// Returns the shape at `body_frame` of `body` against the pad at `pad_frame` of `sensor`. nullptr
/// is the world.
template <class N>
void pad_touch(const LinkPose<N>* sensor, const Frame<double>& pad_frame, const LinkPose<N>* body,
               const Frame<double>& body_frame, Touch<N>& out) {
  const LinkPose<N> still = {{diagonal(N(1.0)), zero3<N>()}, zero6<N>()};
  const LinkPose<N>& one = sensor == nullptr ? still : *sensor;
  const LinkPose<N>& two = body == nullptr ? still : *body;
  const Frame<N> pad = broadcast<N>(pad_frame);
  const Frame<N> link = relative(one.world, two.world);
  const Frame<N> shape = relative(pad, compose(link, broadcast<N>(body_frame)));
  const Vec6<N> twist = motion_to_child(pad, motion_to_parent(link, two.V) - one.V);
  out.Q = shape.R;
  out.c = shape.p;
  out.omega = twist.a;
  out.v = twist.l;
}

/// Copies the motion of the link pairs with layers at the x of kinematics(), (those,
/// kPairMotionNumbers). That of links that are apart is not set.
template <class N>
void pair_motions(const ModelView& model, const StageArgs<N>& a, N* out) {
  for_each_link_pair(model, a, [&](int g) {
    if (model.link_pairs[g].layer < 0 || is_apart(a, g)) return;
    const ContactScratch<N>& o = a.contacts[g];
    N* const to = out + kPairMotionNumbers * model.link_pairs[g].layer;
    for (int i = 0; i < 9; ++i) to[i] = o.link2_in_1.R.m[i / 3][i % 3];
    to[9] = o.link2_in_1.p.x, to[10] = o.link2_in_1.p.y, to[11] = o.link2_in_1.p.z;
    to[12] = o.W.a.x, to[13] = o.W.a.y, to[14] = o.W.a.z;
    to[15] = o.W.l.x, to[16] = o.W.l.y, to[17] = o.W.l.z;
  });
}

}  // namespace tangere::kernels
