// SPDX-License-Identifier: Apache-2.0
// The penalty law of one point, over any number type (docs/contact.md). Contacts, the ground,
// tactile points and their reverse mode all use it.
//
//   N(d, ḋ) is the normal force, d < 0 the penetration;  f = N n + f_t
//   R = (-k_n + k_d ḋ) d;  law linear: R = -k_n d - c ḋ, where c fades at depths below the ramp
//   N = max(0, R);  law paper, and law linear with ramp 0: N = R
//   f_t = -k_t v_t            if k_t |v_t| ≤ μ |N|    (stick; also at v_t = 0 and on the kink)
//       = -μ |N| v_t / |v_t|  else                    (slip)
// With ramp 0, law linear is the published one: it pulls, and its friction bound is μ k_n |d|.
#pragma once

#include "kernels/contact/contact_types.hpp"
#include "kernels/numbers/inverse_sqrt.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

template <class N>
struct LawParameters : Coefficients<N> {
  ContactLaw law;
  double ramp;
  /// At slipping points, 1 takes the derivative of -scale v_t, and 0 takes its secant, -scale.
  N friction_tangent = N(1.0);
};

/// The law of a point that stands for an area `weight` [m²], from coefficients by area.
template <class N>
[[gnu::always_inline]] inline void set_weighted(const LawParameters<N>& law, const N& weight,
                                                LawParameters<N>& out) {
  for (std::size_t k = 0; k < kCoefficients; ++k)
    out[k] = scales_with_area(k) ? weight * law[k] : law[k];
}

/// How a b + c is rounded. Contacts of bodies round twice. Tactile points round once where lanes
/// fuse.
struct Rounded {
  template <class N>
  static N add(const N& a, const N& b, const N& c) {
    return a * b + c;
  }
  template <class N>
  static N subtract(const N& a, const N& b, const N& c) {
    return c - a * b;
  }
};
struct Fused {
  template <class N>
  static N add(const N& a, const N& b, const N& c) {
    return mul_add(a, b, c);
  }
  template <class N>
  static N subtract(const N& a, const N& b, const N& c) {
    return mul_sub_from(a, b, c);
  }
};

/// Returns R whether or not the point touches. `damping` of the linear law already includes its
/// ramp.
template <class Rounding, class N>
[[gnu::always_inline]] inline N raw_force(ContactLaw law, const N& minus_kn, const N& damping,
                                          const N& d, const N& rate) {
  if (law == ContactLaw::linear) return Rounding::subtract(damping, rate, minus_kn * d);
  return Rounding::add(damping, rate, minus_kn) * d;
}

/// Computes N and the friction bound divided by μ for a tactile point, whose law is clamped or
/// paper. d = 0 gives zeros.
template <ContactLaw Law, class N>
void normal_force_alone(const N& minus_kn, const N& damping, const N& d, const N& rate, N& force,
                        N& bound) {
  static_assert(Law != ContactLaw::linear);
  const N zero(0.0), raw = raw_force<Fused>(Law, minus_kn, damping, d, rate);
  force = Law == ContactLaw::clamped ? max(raw, zero) : raw;
  bound = Law == ContactLaw::clamped ? force : max(force, zero - force);
}

/// Returns the scale in f_t = -scale v_t: the smaller of k_t and μ B/|v_t|. `square` = |v_t|² > 0.
template <class N>
N friction_scale(const N& kt, const N& mu, const N& bound, const N& square) {
  return min(kt, mu * bound * inverse_sqrt(square));
}

/// N and the friction bound divided by μ, with their slopes.
template <class N>
struct NormalForce {
  N force, d_slope, rate_slope;  ///< N, ∂N/∂d, ∂N/∂ḋ
  N bound, bound_d, bound_rate;  ///< B with |f_t| ≤ μ B, and its slopes
};

/// Returns the values for d < 0. Force and slopes are zero elsewhere and where the law clamps.
template <class N>
NormalForce<N> normal_force(const LawParameters<N>& p, const N& d, const N& rate) {
  const N zero(0.0);
  NormalForce<N> r;
  auto active = d < zero;
  if (p.law == ContactLaw::linear) {
    N damping = p.damping;
    r.d_slope = -p.kn;
    if (p.ramp > 0) {
      const N inverse(1.0 / p.ramp);
      const auto fading = abs(d) < N(p.ramp);
      damping = p.damping * select(fading, abs(d) * inverse, N(1.0));
      r.d_slope = select(fading, p.damping * inverse * rate - p.kn, -p.kn);
    }
    r.force = raw_force<Rounded>(p.law, -p.kn, damping, d, rate);
    r.rate_slope = -damping;
    auto acting = active;
    if (p.ramp > 0) acting = active & (r.force > zero);
    r.force = select(acting, r.force, zero);
    r.d_slope = select(acting, r.d_slope, zero);
    r.rate_slope = select(acting, r.rate_slope, zero);
    if (p.ramp <= 0) {  // published: friction from the spring alone
      r.bound = select(active, -(p.kn * d), zero);
      r.bound_d = select(active, -p.kn, zero);
      r.bound_rate = zero;
      return r;
    }
  } else {
    const N stiffness = Rounded::add(p.damping, rate, -p.kn);
    r.force = raw_force<Rounded>(p.law, -p.kn, p.damping, d, rate);
    if (p.law == ContactLaw::clamped) active = active & (r.force > zero);
    r.force = select(active, r.force, zero);
    r.d_slope = select(active, stiffness, zero);
    r.rate_slope = select(active, p.damping * d, zero);
  }
  const auto pulling = r.force < zero;  // law paper only
  r.bound = abs(r.force);
  r.bound_d = select(pulling, -r.d_slope, r.d_slope);
  r.bound_rate = select(pulling, -r.rate_slope, r.rate_slope);
  return r;
}

/// Turns cotangents of N and B into those of k_n and k_d. They are zero where the normal force is
/// clamped.
template <class N>
void pull_back_normal_force(const LawParameters<N>& p, const N& d, const N& rate,
                            const NormalForce<N>& at, const N& force, const N& bound,
                            Coefficients<N>& out) {
  const N zero(0.0), one(1.0);
  const auto pulling = at.force < zero;  // law paper: B = -N
  const N both = force + select(pulling, -bound, bound);
  if (p.law == ContactLaw::linear) {
    if (p.ramp > 0) {
      const N pushing = select(at.force > zero, one, zero);
      const N ramp = min(abs(d) * N(1.0 / p.ramp), one);
      out.kn -= pushing * both * d;
      out.damping -= pushing * both * ramp * rate;
    } else {  // N = R, B = k_n |d|
      out.kn -= (force + bound) * d;
      out.damping -= force * rate;
    }
    return;
  }
  const N active = p.law == ContactLaw::paper ? one : select(at.force > zero, one, zero);
  out.kn -= active * both * d;
  out.damping = mul_add(active * both, d * rate, out.damping);
}

/// f_t = -scale v_t, with what its derivative needs.
template <class N>
struct Friction {
  N scale;            ///< k_t when sticking, μ B / |v_t| when slipping, 0 without a force N
  N slip;             ///< 1 when slipping and its derivative counts, else 0
  Vec3<N> direction;  ///< v_t / |v_t| where slip is 1, else 0
};

/// `square` = |v_t|². `inverse_speed` = 1/|v_t|, finite at v_t = 0.
template <class N>
Friction<N> friction(const LawParameters<N>& p, const NormalForce<N>& normal, const Vec3<N>& vt,
                     const N& square, const N& inverse_speed) {
  const N zero(0.0);
  const N limit = p.mu * normal.bound;
  const auto slipping = p.kt * (square * inverse_speed) > limit;  // false at v_t = 0
  const N inverse = select(slipping, inverse_speed, zero);
  Friction<N> f;
  // Without a force N there is no friction at any v_t, so its derivative is 0 at v_t = 0 as well.
  f.scale = select(slipping, limit * inverse, select(limit > zero, p.kt, zero));
  f.slip = select(slipping, p.friction_tangent, zero);
  f.direction = (f.slip * inverse) * vt;
  return f;
}

template <class N>
Friction<N> friction(const LawParameters<N>& p, const NormalForce<N>& normal, const Vec3<N>& vt) {
  const N square = dot(vt, vt);
  return friction(p, normal, vt, square, inverse_sqrt(square));
}

}  // namespace tangere::kernels
