// SPDX-License-Identifier: Apache-2.0
// How a tactile field changes with the motion of the shapes on it, eight points at a time, in
// double (the δ's of kernels/contact/pair_contact.hpp). This is the forward counterpart of
// kernels/reverse/tactile_pullback.hpp.
#pragma once

#include "kernels/reverse/tactile_pullback.hpp"
#include "kernels/tactile/tactile_numbers.hpp"

namespace tangere::kernels {

/// Returns δf of one touching point for body 2's displacement ε = (θ; ρ) and δW.
template <class Shape, class N>
Vec3<N> force_tangent(const LawParameters<N>& law, const PointContact<N>& p, const Vec3<N>& omega,
                      const Vec6<N>& displacement, const Vec6<N>& twist) {
  const Vec3<N>&n = p.n, &t = p.tangential.direction;
  const Vec3<N> rho = displacement.l + cross(displacement.a, p.x2), turn = cross(displacement.a, n);
  const N d = -dot(n, rho);
  Vec3<N> dn = turn;
  if constexpr (Shape::kBending != Bending::flat) dn -= bend<Shape>(p, mul_add(p.d, turn, rho));
  const Vec3<N> dx = -mul_add(d, n, p.d * dn);
  const Vec3<N> du = -(twist.l + cross(twist.a, p.x2) + cross(omega, dx));
  const N rate = dot(dn, p.u) + dot(n, du);
  const Vec3<N> dvt = du - mul_add(rate, n, p.rate * dn);
  const N normal = mul_add(p.normal.d_slope, d, p.normal.rate_slope * rate);
  const N bound = mul_add(p.normal.bound_d, d, p.normal.bound_rate * rate);
  const N along = mul_add(law.mu, bound, -(p.tangential.scale * dot(t, dvt)));
  return mul_add(normal, n, p.normal.force * dn) - mul_add(p.tangential.scale, dvt, along * t);
}

/// Returns the field that a force causes at the points of a tile from k on: the transpose of
/// force_cotangent().
template <class A>
Vec3<Lanes<A>> field_of_force(const PadTiles& pad, int tile, int k, const Vec3<Lanes<A>>& f) {
  const Vec3<Lanes<A>> turned = {f.x, f.y, -f.z};
  if (pad.curved())
    return in_point_axes<InDouble<A>>(pad.frames + 9 * kTactileTile * tile + k, turned);
  return pad.skewed ? in_skewed_axes(pad.axes, turned) : turned;
}

/// Adds one shape's share to every tile that it reaches.
template <class A>
void add_touch_tangent(const TactileTangent& a, int touch) {
  using N = Lanes<A>;
  const PadMotion<N> m = pad_motion<N>(a.touches[touch], a.law);
  const TouchShape& s = a.shapes[touch];
  const TouchTangent& moves = a.tangents[touch];
  const Vec6<N> displacement = {broadcast<N>(moves.displacement.a),
                                broadcast<N>(moves.displacement.l)};
  const Vec6<N> twist = {broadcast<N>(moves.twist.a), broadcast<N>(moves.twist.l)};
  with_distance<N>(
      s.shape, Vec3<double>{s.size[0], s.size[1], s.size[2]},
      [&]<class Shape>(const Shape& shape) {
        for (int i = 0; i < a.count; ++i) {
          const int tile = a.tiles[i];
          if (!reaches(shape, m, *a.pad, tile)) continue;
          for (int k = 0; k < kTactileTile; k += kGroup) {
            const LawParameters<N> law = law_of_points<A>(*a.pad, tile, k, m.law);
            const PointContact<N> p =
                point_contact(shape, law, m.Q, m.c, m.omega, m.v, tile_points<A>(*a.pad, tile, k));
            const auto touching = p.d < N(0.0);
            if (!any(touching)) continue;
            const Vec3<N> f = select(touching, N(1.0), N(0.0)) *
                              force_tangent<Shape>(law, p, m.omega, displacement, twist);
            const Vec3<N> field = field_of_force<A>(*a.pad, tile, k, f);
            double* to = a.change + 3 * kTactileTile * i + k;
            store_anywhere(load_anywhere<A>(to) + field.x, to);
            store_anywhere(load_anywhere<A>(to + kTactileTile) + field.y, to + kTactileTile);
            store_anywhere(load_anywhere<A>(to + 2 * kTactileTile) + field.z,
                           to + 2 * kTactileTile);
          }
        }
      },
      s.grid);
}

template <class A>
void field_tangent(const TactileTangent& a) {
  for (int i = 0; i < 3 * kTactileTile * a.count; ++i) a.change[i] = 0;
  for (int k = 0; k < a.n_touches; ++k) add_touch_tangent<A>(a, k);
}

}  // namespace tangere::kernels
