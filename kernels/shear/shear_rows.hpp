// SPDX-License-Identifier: Apache-2.0
// Shear state for all environments of a group at once: poses of contacts with shear springs, and
// anchors and updates of points on the ground. N are the numbers of the group's lanes.
#pragma once

#include "kernels/shear/update_shear_state.hpp"
#include "kernels/step/arguments.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Computes the pose of the touched shape in body 1 and W, in body 1's axes, of every contact with
/// shear springs. Consecutive contacts of the same links share the relative motion. `links`:
/// (n_links).
template <class N>
void find_touches(const ModelView& m, const LinkPose<N>* links, LinkPose<N>* out) {
  const LinkPose<N> still = {{diagonal(N(1.0)), zero3<N>()}, zero6<N>()};
  LinkPose<N> motion;  // link 2 in link 1, and W
  for (int k = 0; k < m.n_shear_springs; ++k) {
    const PairContact& c = m.memories[k].contact;
    const bool same = k > 0 && m.memories[k - 1].contact.link1 == c.link1 &&
                      m.memories[k - 1].contact.link2 == c.link2;
    if (!same) {
      const LinkPose<N>& one = c.link1 < 0 ? still : links[c.link1];
      const LinkPose<N>& two = c.link2 < 0 ? still : links[c.link2];
      motion.world = relative(one.world, two.world);
      motion.V = motion_to_parent(motion.world, two.V) - one.V;
    }
    out[k] = {compose(motion.world, broadcast<N>(c.frame2)), motion.V};
  }
}

template <class N>
LoadedTouch<N> ground_touch(const ShearSpringContact& of, const LinkPose<N>& at,
                            const double* block, int group) {
  return {at.world.R,
          at.world.p,
          at.V.a,
          at.V.l,
          load_law<N>(of.contact.parameters, of.contact.law, of.contact.ramp, block, group),
          ParameterLoad<N>::load({of.radius, of.radius_row}, block, group),
          true};
}

/// Place k of a contact's points.
template <class N>
Vec3<N> place_of(const ShearSpringContact& of, int k) {
  const double* p = of.contact.points + 3 * k;
  return {N(p[0]), N(p[1]), N(p[2])};
}

/// Computes the anchors of all points on the ground, one contact after the other. `s`: (points, 3)
/// elastic displacements, body 1's axes; null: zeros. `anchors`: (points, kAnchorNumbers).
template <class N>
void recall_ground(const ModelView& m, const LinkPose<N>* touches, const N* s, N* anchors,
                   const double* block, int group) {
  for (int i = 0; i < m.n_shear_springs; ++i) {
    const ShearSpringContact& of = m.memories[i];
    if (!of.ground) continue;
    const LoadedTouch<N> t = ground_touch(of, touches[i], block, group);
    for (int k = 0; k < of.contact.n_points; ++k, anchors += kAnchorNumbers) {
      Vec3<N> s_start = zero3<N>();
      if (s != nullptr) s_start = {s[0], s[1], s[2]}, s += 3;
      const Anchor<N> x = recalled(PlaneDistance<N>{}, t, place_of<N>(of, k), s_start);
      anchors[0] = x.b.x, anchors[1] = x.b.y, anchors[2] = x.b.z;
      anchors[3] = x.a.x, anchors[4] = x.a.y, anchors[5] = x.a.z;
      anchors[6] = x.gap;
    }
  }
}

/// Computes s' of all points on the ground. `kept`: (points, 4) out: s' in body 1's axes, then 1 at
/// points that touch, else 0. Of points that touch in no lane only the last number is set.
template <class N>
void advance_ground(const ModelView& m, const LinkPose<N>* touches, const N* anchors, N* kept,
                    const double* block, int group) {
  const N zero(0.0), one(1.0);
  for (int i = 0; i < m.n_shear_springs; ++i) {
    const ShearSpringContact& of = m.memories[i];
    if (!of.ground) continue;
    const LoadedTouch<N> t = ground_touch(of, touches[i], block, group);
    for (int k = 0; k < of.contact.n_points; ++k, anchors += kAnchorNumbers, kept += 4) {
      ElasticPoint<N> p;
      find_place(PlaneDistance<N>{}, t, place_of<N>(of, k), p);
      const auto touching = p.d < zero;
      const N touches_here = select(touching, one, zero);
      kept[3] = touches_here;
      if (!any(touching)) continue;
      find_motion(t.law, t.omega, t.v, p);
      add_spring(t.law, t.Q, t.c, load_anchor<N>([&](int c) { return anchors[c]; }), p);
      const Vec3<N> s = (touches_here * p.hold) * p.s;
      kept[0] = s.x, kept[1] = s.y, kept[2] = s.z;
    }
  }
}

}  // namespace tangere::kernels
