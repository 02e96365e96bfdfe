// SPDX-License-Identifier: Apache-2.0
// Chooses the faces of a cuboid that a convex body may touch, once per solve, at the pose at which
// the solve starts. No state is kept between solves.
//
// In the cuboid's axes, with y the centre of the body, s the half edges and p_k the body's half
// width along axis k, the face on the body's side of axis k is
//   g_k = |y_k| - p_k - s_k
// away from the body. Chosen are all faces with g_k ≥ -touch, which the body does not penetrate. If
// there is none, it is the face of least penetration. If the penetration along the body's own axes
// is less than half of that, an edge of the cuboid touches a face of the body: then no face is
// chosen, and each point takes its own distance.
#pragma once

#include "kernels/contact/ball_contact.hpp"
#include "kernels/contact/shapes/cuboid_face.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// `touch` as a share of the smallest p_k + s_k. Contacts at rest are less deep, and where a body
/// slides from one cuboid to the next, it must not catch on the side of the next one.
inline constexpr double kTouchingShare = 0.02;

/// Returns the faces of pair k: of each axis +1 or -1 where the face at that end is chosen, else 0.
/// All 0: the nearest face, point by point; so for pairs that are not faced.
template <class N>
Vec3<N> faces_of(const StageArgs<N>& a, const PairContact& pair, int k) {
  if (!pair.faced) return zero3<N>();
  return {a.faces[3 * k], a.faces[3 * k + 1], a.faces[3 * k + 2]};
}

template <class N>
GrownShape<N> grown_shape(const PairContact& pair, const Vec3<N>& size) {
  if constexpr (std::is_same_v<N, Dual<double>>)
    return {pair.shape, size, {pair.ball_radius, pair.ball_tangent}};
  else
    return {pair.shape, size, N(pair.ball_radius)};
}

/// Calls f with the distance of a pair's touched shape.
template <class N, class F>
auto with_touched(const PairContact& pair, const Vec3<N>& size, const Vec3<N>& faces, const F& f) {
  if (pair.faced || pair.covered)  // one call of f, because its code is inlined
    return f(pair.faced ? CuboidFace<N>::of(size, faces, pair.overhang)
                        : CuboidFace<N>::continued(size, pair.beyond));
  if (pair.ball_radius > 0) return f(grown_shape(pair, size));
  return with_distance<N>(pair.shape, size, f, pair.grid);
}

/// Half the width of a hull along e, a unit vector in its axes.
template <class N>
N half_width(const Hull& hull, const Vec3<N>& e) {
  const N straight = mul_add(N(hull.straight.x), abs(e.x),
                             mul_add(N(hull.straight.y), abs(e.y), N(hull.straight.z) * abs(e.z)));
  if (!hull.rounded) return straight;
  const Vec3<N> round = {N(hull.round.x) * e.x, N(hull.round.y) * e.y, N(hull.round.z) * e.z};
  return straight + sqrt(dot(round, round));
}

/// A body against a cuboid: y, p_k + s_k, and whether the body reaches around.
template <class N>
struct Approach {
  Vec3<N> y, sum;
  N around;  ///< 1: it does
};

/// Computes the widths along the cuboid's axes, and the penetration along the body's own.
template <class N>
void measure(const PairContact& pair, const Frame<N>& at, const Vec3<N>& half, Approach<N>& out) {
  const Hull& hull = pair.hull;
  const Mat3<N> M = transpose(broadcast<N>(hull.frame.R)) * at.R;  // columns: the cuboid's axes
  const auto sum_along = [&](int k, const N& s) {
    return half_width(hull, Vec3<N>{M.m[0][k], M.m[1][k], M.m[2][k]}) + s;
  };
  out.sum = {sum_along(0, half.x), sum_along(1, half.y), sum_along(2, half.z)};
  const N best =
      max(abs(out.y.x) - out.sum.x, max(abs(out.y.y) - out.sum.y, abs(out.y.z) - out.sum.z));
  const Vec3<N> place = M * out.y;  // rows of M: the body's axes
  const auto own_gap = [&](int k, const N& c, double width) {
    const N s =
        mul_add(half.x, abs(M.m[k][0]), mul_add(half.y, abs(M.m[k][1]), half.z * abs(M.m[k][2])));
    return abs(c) - (N(width) + s);
  };
  const Vec3<double> widths = hull.straight + hull.round;
  const N own = max(own_gap(0, place.x, widths.x),
                    max(own_gap(1, place.y, widths.y), own_gap(2, place.z, widths.z)));
  const auto around = (best < N(0.0)) & (best < N(2.0) * own - N(4 * pair.overhang));
  out.around = select(around, N(1.0), N(0.0));
}

/// Returns the faces for one pair. `at`: the cuboid in body 1. `half`: its half edges. A body that
/// is far away, by the ball around it, is as wide as this ball. Where all lanes are far, there is
/// nothing to measure.
template <class N>
Vec3<N> chosen_faces(const PairContact& pair, const Frame<N>& at, const Vec3<N>& half) {
  const N zero(0.0), one(1.0), radius(pair.hull.radius);
  Approach<N> a;
  a.y = transposed_times(at.R, broadcast<N>(pair.hull.frame.p) - at.p);
  const Vec3<N> ball_sum = {half.x + radius, half.y + radius, half.z + radius};
  const N apart =
      max(abs(a.y.x) - ball_sum.x, max(abs(a.y.y) - ball_sum.y, abs(a.y.z) - ball_sum.z));
  const auto far = apart > zero;
  a.sum = ball_sum;
  a.around = zero;
  if (any(apart <= zero)) {
    Approach<N> near = a;
    measure(pair, at, half, near);
    a.sum = select(far, ball_sum, near.sum);
    a.around = select(far, zero, near.around);
  }
  const Vec3<N> gap = {abs(a.y.x) - a.sum.x, abs(a.y.y) - a.sum.y, abs(a.y.z) - a.sum.z};
  const N best = max(gap.x, max(gap.y, gap.z));
  const N touch = N(kTouchingShare) * min(a.sum.x, min(a.sum.y, a.sum.z));
  const N least = select(a.around > zero, N(HUGE_VAL), min(-touch, best));
  const auto side = [&](const N& s, const N& place) {
    return select(s >= least, select(place < zero, -one, one), zero);
  };
  return {side(gap.x, a.y.x), side(gap.y, a.y.y), side(gap.z, a.y.z)};
}

}  // namespace tangere::kernels
