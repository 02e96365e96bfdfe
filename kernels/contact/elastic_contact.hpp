// SPDX-License-Identifier: Apache-2.0
// Contact law with shear springs: a tangential spring at every touching point, in parallel with the
// damper of kernels/contact/contact_law.hpp (derivation: docs/shear.md).
//
// A point has two anchors since the last accepted state: b in body 1, where the surfaces touched,
// and a in the touched shape, which lags behind by the elastic displacement s. With G = (Q, c) the
// shape in body 1, P = I - n nᵀ and x the place where the force acts:
//   A = c + Q a,  r = b - A,  η = n·r,  s = β P r,  w = k_s s + k_t v_t
//   λ = 1 if |w| ≤ μ B, else μ B/|w|,   f = N n - λ w
// β = d/(d - g) is the share of the step after the point crossed the surface, where g ≥ 0 is how
// far it was from it at the last accepted state. It is 1 for points that touched then.
// The shear state after an accepted step is s' = λ s, from which b, a and g follow
// (kernels/shear/anchors_from_state.hpp).
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

/// Anchors of a point and the distance g at the last accepted state.
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

/// A point at ξ, and where the numbers of its anchor are: i at numbers[i stride]. They are read
/// where the point touches.
template <class N>
struct ElasticPlace {
  Vec3<N> xi;
  const N* numbers;
  int stride;

  [[gnu::always_inline]] Anchor<N> anchor() const {
    return load_anchor<N>([this](int i) { return numbers[i * stride]; });
  }
};

/// The spring of one point.
template <class N>
struct Spring {
  Vec3<N> r, along;  ///< r and P r
  Vec3<N> s, w;
  N eta, beta, beta_d;
  N square, inverse_size;  ///< |w|², 1/|w|
};
/// Computes the spring from r = b - A. Points that touched at the last state have β = 1 to the bit,
/// whatever the other lanes do.
template <class N>
[[gnu::always_inline]] inline Spring<N> stretched(const N& ks, const N& kt, const N& d,
                                                  const Vec3<N>& n, const Vec3<N>& vt,
                                                  const Vec3<N>& r, const N& gap) {
  const N zero(0.0), one(1.0);
  Spring<N> e;
  e.r = r;
  e.eta = dot(n, r);
  e.along = mul_add(-e.eta, n, r);
  e.beta = one;
  e.beta_d = zero;
  const auto landing = (d < zero) & (gap > zero);
  if (any(landing)) {
    const N inverse = one / select(landing, d - gap, -one);
    e.beta = select(landing, d * inverse, one);
    e.beta_d = select(landing, -(gap * inverse * inverse), zero);
  }
  e.s = e.beta * e.along;
  e.w = mul_add(ks, e.s, kt * vt);
  e.square = dot(e.w, e.w);
  e.inverse_size = inverse_sqrt(e.square);
  return e;
}

/// Returns λ, from |w|², 1/|w| and μB. As in friction(): without a force N nothing holds, at w = 0
/// as well.
template <class N>
[[gnu::always_inline]] inline N held(const N& square, const N& inverse_size, const N& limit) {
  const N zero(0.0), one(1.0);
  const auto slipping = square * inverse_size > limit;  // false at w = 0
  return select(slipping, limit * inverse_size, select(limit > zero, one, zero));
}

/// λ, its factor on the damper, and 1/|w| if the point slips, else 0.
template <class N>
struct Grip {
  N hold, inverse_w;
  Friction<N> damper;
};
template <class N>
[[gnu::always_inline]] inline Grip<N> gripped(const LawParameters<N>& law,
                                              const NormalForce<N>& normal, const Spring<N>& e) {
  const N zero(0.0);
  const N limit = law.mu * normal.bound;
  const auto slipping = e.square * e.inverse_size > limit;
  Grip<N> g;
  g.inverse_w = select(slipping, e.inverse_size, zero);
  g.hold = held(e.square, e.inverse_size, limit);
  g.damper.scale = g.hold * law.kt;
  g.damper.slip = select(slipping, law.friction_tangent, zero);
  g.damper.direction = (g.damper.slip * g.inverse_w) * e.w;
  return g;
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
  const Vec3<N> A = c + Q * anchor.a;
  p.arm = p.x2 - A;
  const Spring<N> e = stretched(law.ks, law.kt, p.d, p.n, p.vt, anchor.b - A, anchor.gap);
  p.r = e.r, p.s = e.s, p.w = e.w;
  p.eta = e.eta, p.beta = e.beta, p.beta_d = e.beta_d;
  const Grip<N> g = gripped(law, p.normal, e);
  p.hold = g.hold;
  p.inverse_w = g.inverse_w;
  p.tangential = g.damper;
  const N gate = select(p.d < N(0.0), N(1.0), N(0.0));
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

/// Adds one point or sphere on the ground. `ground`: its frame in the body's axes,
/// with the normal as its third column. Returns false
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
    const N stiffness = gate * p.hold * law.ks, k = stiffness * p.beta, k_eta = k * p.eta;
    const Vec3<N>&t = p.tangential.direction, A = p.x2 - p.arm;
    // k (P - t tᵀ) δr and what m does; σ = β'_d (P r - t (t·P r)) by δd
    const Vec3<N> along = mul_add(-p.eta, m, p.r);
    const Vec3<N> f_d = (stiffness * p.beta_d) * (along - dot(t, along) * t);
    r.f_rho += outer(k * m - f_d, m) + outer(k * t, t) - diagonal(k);
    r.f_theta += skew(mul_add(k, A, k_eta * m)) + outer(k * m, cross(p.r + A, m)) -
                 outer(t, k * cross(t, A) + k_eta * cross(t, m)) + outer(f_d, cross(m, centre));
    add_ground_derivative(sums, p, r);
  }
  return true;
}

}  // namespace tangere::kernels
