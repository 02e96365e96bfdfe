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

/// Returns the lanes in which the ball around the points of a body reaches the ground. `link`: in
/// the world.
template <class N>
unsigned near_ground(const ModelView& m, const GroundContact& of, const Frame<N>& link,
                     const double* block, int group) {
  const Vec3<N> middle = link.R * broadcast<N>(of.middle) + link.p;
  const N height = dot(broadcast<N>(m.ground_normal), middle - broadcast<N>(m.ground_point));
  const N radius = ground_radius<N>(of, block, group);
  const N extent = of.radius_row < 0 ? N(of.extent) : N(of.extent) + radius;
  return lane_bits(height < extent + N(kTouchMargin));
}

/// Clears the lanes of contacts with the ground and of sensors in which the ball around the points
/// does not reach the shape. `lanes`: (n_shear_springs).
template <class N>
void clear_far_contacts(const ModelView& m, const LinkPose<N>* links, const double* block,
                        int group, unsigned* lanes) {
  ContactLinks<N> two{.links = links};
  Frame<N> second;  // link 2 in link 1
  for (int k = 0; k < m.n_shear_springs; ++k) {
    const ShearSpringContact& of = m.memories[k];
    const PairContact& c = of.contact;
    if (lanes[k] == 0) continue;
    if (of.ground)
      lanes[k] &= near_ground(m, m.grounds[of.grounded], two.at(c.link1).world, block, group);
    if (of.sensor < 0) continue;
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

/// Computes anchors of all points of a contact on the ground, (points, kAnchorNumbers). `s_of`(k):
/// elastic displacement of point k.
template <class N, class Displacement>
void recall_ground_points(const ShearSpringContact& of, const LoadedTouch<N>& t,
                          const Displacement& s_of, N* anchors) {
  for (int k = 0; k < of.contact.n_points; ++k, anchors += kAnchorNumbers) {
    const Anchor<N> x = recalled(PlaneDistance<N>{}, t, place_of<N>(of, k), s_of(k));
    anchors[0] = x.b.x, anchors[1] = x.b.y, anchors[2] = x.b.z;
    anchors[3] = x.a.x, anchors[4] = x.a.y, anchors[5] = x.a.z;
    anchors[6] = x.gap;
  }
}
/// The same of a lone environment, eight points at a time.
template <class A, class Displacement>
void recall_ground_points(const ShearSpringContact& of, const LoadedTouch<OneLane<A>>& t,
                          const Displacement& s_of, OneLane<A>* anchors) {
  using N = Lanes<A>;
  const auto spread = [](const auto& from, auto& to) {
    for (std::size_t i = 0; i < sizeof(from) / sizeof(double); ++i)
      reinterpret_cast<N*>(&to)[i] = N(reinterpret_cast<const double*>(&from)[i]);
  };
  LoadedTouch<N> all;
  spread(t.Q, all.Q), spread(t.c, all.c), spread(t.radius, all.radius);
  all.ground = true;
  for (int first = 0; first < of.contact.n_points; first += kGroup) {
    const int rest = of.contact.n_points - first, count = rest < kGroup ? rest : kGroup;
    alignas(64) double s[3 * kGroup] = {}, x[kAnchorNumbers * kGroup];
    for (int i = 0; i < count; ++i) {
      const Vec3<OneLane<A>> one = s_of(first + i);
      s[i] = one.x.x, s[kGroup + i] = one.y.x, s[2 * kGroup + i] = one.z.x;
    }
    const Anchor<N> at = recalled(PlaneDistance<N>{}, all, load3<A>(of.places, of.stride, first),
                                  load3<A>(s, kGroup, 0));
    store3(at.b, x, kGroup, 0);
    store3(at.a, x + 3 * kGroup, kGroup, 0);
    store_lanes(at.gap, x + 6 * kGroup);
    for (int i = 0; i < count; ++i)
      for (int c = 0; c < kAnchorNumbers; ++c)
        anchors[kAnchorNumbers * (first + i) + c] = x[c * kGroup + i];
  }
}

/// Computes the anchors of all points on the ground, one contact after the other. `s`: (points, 3)
/// elastic displacements, body 1's axes; null: zeros. `anchors`: (points, kAnchorNumbers).
template <class N>
void recall_ground(const ModelView& m, const LinkPose<N>* touches, const N* s, N* anchors,
                   const double* block, int group) {
  for (int i = 0; i < m.n_shear_springs; ++i) {
    const ShearSpringContact& of = m.memories[i];
    if (!of.ground) continue;
    const int first = m.grounds[of.grounded].first_anchor;
    const N* const from = s == nullptr ? nullptr : s + 3 * first;
    recall_ground_points(
        of, ground_touch(of, touches[i], block, group),
        [from](int k) {
          return from == nullptr ? zero3<N>()
                                 : Vec3<N>{from[3 * k], from[3 * k + 1], from[3 * k + 2]};
        },
        anchors + kAnchorNumbers * first);
  }
}

/// Computes s' of the points on the ground, of contacts with lanes[i] ≠ 0. `kept`: (points, 4) out:
/// s' in body 1's axes, then 1 at points that touch, else 0. Of points that touch in no lane only
/// the last number is set.
template <class N>
void advance_ground(const ModelView& m, const LinkPose<N>* touches, const unsigned* lanes,
                    const N* anchors, N* kept, const double* block, int group) {
  const N zero(0.0), one(1.0);
  for (int i = 0; i < m.n_shear_springs; ++i) {
    const ShearSpringContact& of = m.memories[i];
    if (!of.ground || lanes[i] == 0) continue;
    const LoadedTouch<N> t = ground_touch(of, touches[i], block, group);
    for (int k = 0; k < of.contact.n_points; ++k) {
      const int point = m.grounds[of.grounded].first_anchor + k;
      N* const out = kept + 4 * point;
      ElasticPoint<N> p;
      find_place(PlaneDistance<N>{}, t, place_of<N>(of, k), p);
      const auto touching = p.d < zero;
      const N touches_here = select(touching, one, zero);
      out[3] = touches_here;
      if (!any(touching)) continue;
      find_motion(t.law, t.omega, t.v, p);
      add_spring(t.law, t.Q, t.c,
                 load_anchor<N>([&](int c) { return anchors[kAnchorNumbers * point + c]; }), p);
      const Vec3<N> s = (touches_here * p.hold) * p.s;
      out[0] = s.x, out[1] = s.y, out[2] = s.z;
    }
  }
}

}  // namespace tangere::kernels
