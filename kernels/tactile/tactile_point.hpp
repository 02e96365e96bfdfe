// SPDX-License-Identifier: Apache-2.0
// The force on tactile points. Positions are relative to the points' tile, so that single precision
// loses nothing (docs/contact.md).
//
// A point is ξ = t + s, with t its tile's centre and s the offset. Terms that cancel are collected
// in brackets, which are computed in double once per tile:
//   sphere: a = t - c;  D = a + s;  D² - r² = s·(s + 2a) + [a² - r²];  d = |D| - r from it
//   others: y = Qᵀ(t - c), the tile's centre in the shape's axes, e = Qᵀs (kernels/contact/shapes)
//   pressure alone: -N n·e₂, where ḋ = n·(u + s × ω), because n·(ω × d n) = 0
//   velocity at x₂ = ξ - d n:  u = [-(v + ω × t)] + ω × (d n - s)
// Every function acts lane by lane. Lanes are tiles or environments for brackets, and points or
// environments for forces.
#pragma once

#include "kernels/contact/contact_law.hpp"
#include "kernels/tactile/tactile_numbers.hpp"

namespace tangere::kernels {

/// Contact parameters and rotation, in the form that a point needs.
template <class N>
struct PointLaw {
  Vec3<N> omega;
  N minus_kn, kt, mu, damping;
};

/// -(v + ω × t): velocity of the pad relative to the shape, both extended to the tile's centre.
template <class D>
Vec3<D> tile_velocity(const Touch<D>& at, const Vec3<D>& t) {
  return cross(t, at.omega) - at.v;
}

/// Computes the normal force on points at depth d, for n · (u + s × ω): d n has no part in it.
template <class P, ContactLaw Law, class Shape, class N = typename P::N, class M>
Vec3<N> pressing_force(const Shape& shape, const PointLaw<N>& law, const typename P::Offset& s,
                       const N& d, const Vec3<N>& n, const M& touching) {
  const N zero(0.0);
  const Vec3<N>& w = law.omega;
  Vec3<N> u = {mul_add(s.y, w.z, shape.u.x), mul_sub_from(s.x, w.z, shape.u.y),
               mul_sub_from(s.y, w.x, mul_add(s.x, w.y, shape.u.z))};
  if constexpr (P::kCurved) u = {mul_sub_from(s.z, w.y, u.x), mul_add(s.z, w.x, u.y), u.z};
  N normal, bound;
  normal_force_alone<Law>(law.minus_kn, law.damping, select(touching, d, zero), dot(n, u), normal,
                          bound);
  return {mul_add(normal, n.x, zero), mul_add(normal, n.y, zero), mul_sub_from(normal, n.z, zero)};
}

/// Computes the force on the points at offset s: (f·e0, f·e1, -f·e2) in pad axes, +0 where nothing
/// touches. Returns false and leaves `force` alone where no lane touches.
template <class P, ContactLaw Law, class Shape, class N = typename P::N>
bool point_force(const Shape& shape, const PointLaw<N>& law, const typename P::Offset& s,
                 Vec3<N>& force) {
  N d;
  Vec3<N> n;
  const auto touching = shape.distance(s, d, n);
  if (!any(touching)) return false;
  if constexpr (P::kComponents == 1) {
    force = pressing_force<P, Law>(shape, law, s, d, n, touching);
    return true;
  }
  const N zero(0.0);
  Vec3<N> arm = {mul_add(d, n.x, zero - s.x), mul_add(d, n.y, zero - s.y), d * n.z};
  if constexpr (P::kCurved) arm.z = arm.z - s.z;
  const Vec3<N>& w = law.omega;
  const Vec3<N> u = {mul_sub_from(w.z, arm.y, mul_add(w.y, arm.z, shape.u.x)),
                     mul_sub_from(w.x, arm.z, mul_add(w.z, arm.x, shape.u.y)),
                     mul_sub_from(w.y, arm.x, mul_add(w.x, arm.y, shape.u.z))};
  const N rate = dot(n, u);
  const Vec3<N> slide = {mul_sub_from(rate, n.x, u.x), mul_sub_from(rate, n.y, u.y),
                         mul_sub_from(rate, n.z, u.z)};
  N normal, bound;
  normal_force_alone<Law>(law.minus_kn, law.damping, select(touching, d, zero), rate, normal,
                          bound);
  // Without sliding, the bound divided by |v_t| is huge, but nothing is divided by zero.
  const N square = max(dot(slide, slide), N(P::kSmallest * P::kSmallest));
  const N scale = friction_scale(law.kt, law.mu, bound, square);
  // Each sum starts from +0, so that no -0 remains where a factor is zero.
  force = {mul_add(normal, n.x, mul_sub_from(scale, slide.x, zero)),
           mul_add(normal, n.y, mul_sub_from(scale, slide.y, zero)),
           mul_sub_from(normal, n.z, mul_add(scale, slide.z, zero))};
  return true;
}

/// Returns the coefficients of points that have factors of their own. `factors`:
/// (kPointCoefficients, 64).
template <class P, class N = typename P::N>
PointLaw<N> scaled_law(const PointLaw<N>& law, const typename P::Real* factors) {
  const auto factor = [&](int k) { return P::load(factors + k * kTactileTile); };
  return {law.omega, law.minus_kn * factor(0), law.kt * factor(1), law.mu * factor(2),
          law.damping * factor(3)};
}

}  // namespace tangere::kernels
