// SPDX-License-Identifier: Apache-2.0
// Shear state for all environments of a group at once: poses of contacts with shear springs, and
// anchors and updates of points on the ground. N are the numbers of the group's lanes.
#pragma once

#include "kernels/shear/update_shear_state.hpp"
#include "kernels/step/arguments.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Poses and twists of the two links of a contact.
template <class N>
struct ContactLinks {
  LinkPose<N> still = {{diagonal(N(1.0)), zero3<N>()}, zero6<N>()};
  const LinkPose<N>* links;
  const PairContact* last = nullptr;

  /// Whether the contact has other links than that of the last call.
  bool differ(const PairContact& c) {
    const bool same = last != nullptr && last->link1 == c.link1 && last->link2 == c.link2;
    last = &c;
    return !same;
  }
  const LinkPose<N>& at(int link) const { return link < 0 ? still : links[link]; }
};

/// Computes the pose of the touched shape in body 1 and W, in body 1's axes, of contacts `first` …
/// `end` - 1 with shear springs. Those with lanes[k] = 0 are left out; null: none is. Consecutive
/// contacts of the same links share the relative motion. `links`: (n_links).
template <class N>
void find_touches(const ModelView& m, const LinkPose<N>* links, int first, int end,
                  const unsigned* lanes, LinkPose<N>* out) {
  ContactLinks<N> two{.links = links};
  LinkPose<N> motion;  // link 2 in link 1, and W
  for (int k = first; k < end; ++k) {
    if (lanes != nullptr && lanes[k] == 0) continue;
    const PairContact& c = m.memories[k].contact;
    if (two.differ(c)) {
      const LinkPose<N>&one = two.at(c.link1), &other = two.at(c.link2);
      motion.world = relative(one.world, other.world);
      motion.V = motion_to_parent(motion.world, other.V) - one.V;
    }
    out[k] = {compose(motion.world, broadcast<N>(c.frame2)), motion.V};
  }
}

/// Above rounding: some shapes test squares of distances, and no square is below zero [m].
inline constexpr double kTouchMargin = 1e-9;

/// Clears the lanes of sensors' contacts in which the ball around the sensor's points does not
/// reach the shape. `lanes`: (n_shear_springs).
template <class N>
void clear_far_sensors(const ModelView& m, const LinkPose<N>* links, const double* block, int group,
                       unsigned* lanes) {
  ContactLinks<N> two{.links = links};
  Frame<N> second;  // link 2 in link 1
  for (int k = 0; k < m.n_shear_springs; ++k) {
    if (lanes[k] == 0 || m.memories[k].sensor < 0) continue;
    const PairContact& c = m.memories[k].contact;
    if (two.differ(c)) second = relative(two.at(c.link1).world, two.at(c.link2).world);
    const Vec3<N> in_2 = transposed_times(second.R, broadcast<N>(c.middle) - second.p);
    const Vec3<N> y = transposed_times(broadcast<N>(c.frame2.R), in_2 - broadcast<N>(c.frame2.p));
    const N reach(c.extent + kTouchMargin);
    lanes[k] &= with_distance<N>(
        c.shape, load_vector<N>(c.size, c.size_row, block, group),
        [&](const auto& shape) { return lane_bits(nearer_than(shape, y, reach)); }, c.grid);
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
      Vec3<N> remembered = zero3<N>();
      if (s != nullptr) remembered = {s[0], s[1], s[2]}, s += 3;
      const Anchor<N> x = recalled(PlaneDistance<N>{}, t, place_of<N>(of, k), remembered);
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
