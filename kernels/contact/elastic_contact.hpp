// SPDX-License-Identifier: Apache-2.0
// Friction that remembers: a tangential spring at every touching point, beside the damper of
// kernels/contact/contact_law.hpp (docs/shear.md has the law and where it comes from).
//
// A point keeps two anchors since the last accepted state: b in body 1, where the surfaces met, and
// a in the touched shape, which lags behind by the elastic displacement s. With G = (Q, c) the
// shape in body 1, P = I - n nᵀ and x the place where the force acts:
//   A = c + Q a,  r = b - A,  η = n·r,  s = β P r,  w = k_s s + k_t v_t
//   λ = 1 if |w| ≤ μ B, else μ B/|w|,   f = N n - λ w
// β = d/(d - g) is the share of the step after the point crossed the surface, where g ≥ 0 is how
// far it was from it at the last accepted state. It is 1 for points that touched then.
// Accepted states hand on s' = λ s, from which b, a and g follow (kernels/memory/recall.hpp).
//
// Derivatives by ε = (θ; ρ₂) as in kernels/contact/pair_contact.hpp, with m = x - A, Z = η I + n rᵀ
// and s̃ = β'_d P r, β'_d = -g/(d - g)²:
//   s_ρ = -β (P + Z n_ρ) - s̃ nᵀ,   s_θ = -β (P[m] + Z n_θ)
//   f gains -λ k_s (I - t tᵀ)(s_ρ ρ₂ + s_θ θ),  t = w/|w| when slipping, else 0
// and all else is that of the damper with λ k_t in place of its scale and this t. On the ground
// (θ; ρ) is the body's own displacement, and δr = ρ - [A] θ, δd = m·(ρ + θ × ξ_c).
#pragma once

#include "kernels/contact/pair_contact.hpp"

namespace tangere::kernels {

/// What a point remembers, as the law takes it.
template <class N>
struct Anchor {
  Vec3<N> b;  ///< body 1's axes [m]
  Vec3<N> a;  ///< the touched shape's axes [m]
  N gap;      ///< g [m]
};
inline constexpr int kAnchorNumbers = 7;

/// Returns an anchor whose number i is load(i).
template <class N, class Load>
Anchor<N> load_anchor(const Load& load) {
  return {{load(0), load(1), load(2)}, {load(3), load(4), load(5)}, load(6)};
}

template <class N>
struct ElasticPoint : PointContact<N> {
  Vec3<N> arm;  ///< m = x - A
  Vec3<N> r, s, w;
  N eta, beta, beta_d;
  N hold;       ///< λ
  N inverse_w;  ///< 1/|w| where the point slips, else 0
};

/// Computes spring, bound and force of a point whose geometry, velocities and normal force are set.
template <class N>
[[gnu::always_inline]] inline void add_spring(const LawParameters<N>& law, const Mat3<N>& Q,
                                              const Vec3<N>& c, const Anchor<N>& anchor,
                                              ElasticPoint<N>& p) {
  const N zero(0.0), one(1.0);
  const Vec3<N> A = c + Q * anchor.a;
  p.arm = p.x2 - A;
  p.r = anchor.b - A;
  p.eta = dot(p.n, p.r);
  const auto touching = p.d < zero;
  const N inverse = one / select(touching, p.d - anchor.gap, -one);
  p.beta = select(touching, p.d * inverse, one);
  p.beta_d = -(anchor.gap * inverse * inverse);
  p.s = p.beta * mul_add(-p.eta, p.n, p.r);
  p.w = mul_add(law.ks, p.s, law.kt * p.vt);
  const N square = dot(p.w, p.w), inverse_size = inverse_sqrt(square);
  const N limit = law.mu * p.normal.bound;
  const auto slipping = square * inverse_size > limit;  // false at w = 0
  p.inverse_w = select(slipping, inverse_size, zero);
  p.hold = select(slipping, limit * p.inverse_w, one);
  Friction<N>& f = p.tangential;
  f.scale = p.hold * law.kt;
  f.slip = select(slipping, law.friction_tangent, zero);
  f.direction = (f.slip * p.inverse_w) * p.w;
  const N gate = select(touching, one, zero);
  p.force = gate * (p.normal.force * p.n - p.hold * p.w);
}

/// Returns λ k_s (I - t tᵀ).
template <class N>
Mat3<N> spring_matrix(const LawParameters<N>& law, const ElasticPoint<N>& p) {
  const Vec3<N>& t = p.tangential.direction;
  return (p.hold * law.ks) * (diagonal(N(1.0)) - outer(t, t));
}

/// Adds the spring's share to the derivative of a point's force.
template <class Shape, class N>
[[gnu::always_inline]] inline void differentiate_spring(const LawParameters<N>& law,
                                                        const ElasticPoint<N>& p,
                                                        PointDerivative<N>& r) {
  const Mat3<N> P = diagonal(N(1.0)) - outer(p.n, p.n);
  Mat3<N> n_rho, n_theta;
  differentiate_normal<Shape>(p, P, n_rho, n_theta);
  const Mat3<N> Z = diagonal(p.eta) + outer(p.n, p.r);
  Mat3<N> minus_s_rho = P, minus_s_theta = times_skew(P, p.arm) + Z * n_theta;
  if constexpr (Shape::kBending != Bending::flat) minus_s_rho += Z * n_rho;
  const Vec3<N> first_touch = p.beta_d * mul_add(-p.eta, p.n, p.r);
  const Mat3<N> S = spring_matrix(law, p);
  r.f_rho += S * (p.beta * minus_s_rho + outer(first_touch, p.n));
  r.f_theta += S * (p.beta * minus_s_theta);
}

/// Adds one point. Points that do not touch add exact zeros.
template <bool Derivatives, class Shape, class N>
void accumulate_elastic(PairSums<N>& sums, const Shape& shape, const LawParameters<N>& law,
                        const Mat3<N>& Q, const Vec3<N>& c, const Vec3<N>& omega, const Vec3<N>& v,
                        const Vec3<N>& xi, const Anchor<N>& anchor) {
  ElasticPoint<N> p;
  find_place(shape, Q, c, xi, p);
  if (!any(p.d < N(0.0))) return;
  find_motion(law, omega, v, p);
  add_spring(law, Q, c, anchor, p);
  sums.wrench.a += cross(p.x2, p.force);
  sums.wrench.l += p.force;
  if constexpr (Derivatives) {
    PointDerivative<N> r = differentiate<Shape>(law, p, omega);
    differentiate_spring<Shape>(law, p, r);
    add_derivative(sums, p, r);
  }
}

/// The ground in a body's axes: its normal is the third column of Q, c a point of it.
template <class N>
Frame<N> ground_in_body(const Frame<N>& ground, const Frame<N>& body) {
  return relative(body, ground);
}

/// Adds one point or sphere on the ground. `ground`: its frame in the body's axes. Returns false
/// where no lane touches.
template <bool Derivatives, class N>
bool accumulate_elastic_ground(PairSums<N>& sums, const LawParameters<N>& law, const Vec3<N>& m,
                               const N& height, const Vec6<N>& V, const Vec3<N>& centre,
                               const N& radius, const Frame<N>& ground, const Anchor<N>& anchor) {
  ElasticPoint<N> p;
  if (!meets_ground(law, m, height, V, centre, radius, p)) return false;
  add_spring(law, ground.R, ground.p, anchor, p);
  sums.wrench.a += cross(p.x2, p.force);
  sums.wrench.l += p.force;
  if constexpr (Derivatives) {
    GroundDerivative<N> r = differentiate_ground(law, V, centre, radius, p);
    const N gate = select(p.d < N(0.0), N(1.0), N(0.0));
    const Mat3<N> P = diagonal(N(1.0)) - outer(m, m);
    const Mat3<N> Z = diagonal(p.eta) + outer(m, p.r);
    const Vec3<N> first_touch = p.beta_d * mul_add(-p.eta, m, p.r);
    const Mat3<N> S = gate * spring_matrix(law, p);
    const Mat3<N> by_d = outer(first_touch, m);
    const Vec3<N> A = p.x2 - p.arm;
    r.f_rho = r.f_rho - S * (p.beta * P + by_d);
    r.f_theta += S * (p.beta * (times_skew(P, A) + Z * skew(m)) + times_skew(by_d, centre));
    add_ground_derivative(sums, p, r);
  }
  return true;
}

}  // namespace tangere::kernels
