// SPDX-License-Identifier: Apache-2.0
// The penalty law of one point, over any number type (docs/contact.md).
//
//   N(d, ḋ) the normal force, d < 0 the penetration;  f = N n + f_t
//   f_t = -k_t v_t            if k_t |v_t| ≤ μ |N|    (stick; also at v_t = 0 and on the kink)
//       = -μ |N| v_t / |v_t|  else                    (slip)
//   law linear with ramp 0 takes μ k_n |d| as its friction bound, as published.
#pragma once

#include "kernels/contact/contact_types.hpp"
#include "kernels/numbers/inverse_sqrt.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

template <class N>
struct LawParameters : Coefficients<N> {
  ContactLaw law;
  double ramp;
  /// Whether slipping points bring the derivative of -scale v_t (1) or, by its secant, -scale alone
  /// (0).
  N friction_tangent = N(1.0);
};

/// N and the friction bound over μ, with their slopes.
template <class N>
struct NormalForce {
  N force, d_slope, rate_slope;  ///< N, ∂N/∂d, ∂N/∂ḋ
  N bound, bound_d, bound_rate;  ///< B with |f_t| ≤ μ B, and its slopes
};

/// Values for d < 0; zero force and slopes elsewhere and where clamped.
template <class N>
NormalForce<N> normal_force(const LawParameters<N>& p, const N& d, const N& rate) {
  const N zero(0.0);
  NormalForce<N> r;
  auto active = d < zero;
  if (p.law == ContactLaw::linear) {
    if (p.ramp > 0) {
      const N inverse(1.0 / p.ramp);
      const auto fading = abs(d) < N(p.ramp);
      const N ramp = select(fading, abs(d) * inverse, N(1.0));
      r.force = -(p.kn * d) - p.damping * ramp * rate;
      r.d_slope = select(fading, p.damping * inverse * rate - p.kn, -p.kn);
      r.rate_slope = -(p.damping * ramp);
    } else {
      r.force = -(p.kn * d) - p.damping * rate;
      r.d_slope = -p.kn;
      r.rate_slope = -p.damping;
    }
    const auto pushing = active & (r.force > zero);
    const auto bounded = active;
    r.force = select(pushing, r.force, zero);
    r.d_slope = select(pushing, r.d_slope, zero);
    r.rate_slope = select(pushing, r.rate_slope, zero);
    if (p.ramp <= 0) {  // published: friction from the spring alone
      r.bound = select(bounded, -(p.kn * d), zero);
      r.bound_d = select(bounded, -p.kn, zero);
      r.bound_rate = zero;
      return r;
    }
  } else {
    const N stiffness = p.damping * rate - p.kn;
    r.force = stiffness * d;
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

/// f_t = -scale v_t, and what its derivative needs.
template <class N>
struct Friction {
  N scale;            ///< k_t when sticking, μ B / |v_t| when slipping
  N slip;             ///< 1 when slipping and its derivative counts, else 0
  Vec3<N> direction;  ///< v_t / |v_t| where slip is 1, else 0
};

/// `square` = |v_t|², `inverse_speed` = 1/|v_t|, finite at v_t = 0.
template <class N>
Friction<N> friction(const LawParameters<N>& p, const NormalForce<N>& normal, const Vec3<N>& vt,
                     const N& square, const N& inverse_speed) {
  const N zero(0.0);
  const N limit = p.mu * normal.bound;
  const auto slipping = p.kt * (square * inverse_speed) > limit;  // false at v_t = 0
  const N inverse = select(slipping, inverse_speed, zero);
  Friction<N> f;
  f.scale = select(slipping, limit * inverse, p.kt);
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
