// SPDX-License-Identifier: Apache-2.0
// Rotation vectors of quaternions, for springs, limits and motors of spherical joints: log and the
// inverse Jacobians.
//
//   q = (w, u), w ≥ 0 after a sign flip;  m = u/(1 + w) = tan(θ/4) φ/θ,  r = |m|²
//   S = √(1 + r),  r₂ = tan²(θ/8) = r/(1 + S)²
//   B₂ = Σ (-1)^k r₂^k/(2k + 3),  A₂ = 1 - r₂ B₂ = (θ/8)/tan(θ/8)
//       (r₂ ≤ 0.172: twenty terms reach rounding)
//   A = (θ/4)/tan(θ/4) = 2 A₂/(1 + S),  B = (1 - A)/r = (1/(1 + S) + 2 B₂/(1 + S)²)/(1 + S)
//   φ = log q = 4 A m;   J_r⁻¹ = I + X/2 + e X²,  X = [φ],
//       e = (1 - (θ/2) cot(θ/2))/θ² = (A + B)/(16 A²)
//
// Halving the angle twice leaves no root of a small number and no difference of nearly equal ones.
// The result is exact near 0 and up to π, where only the sign of φ is undetermined. The lanes have
// no arc tangent.
#pragma once

#include "kernels/numbers/dual.hpp"
#include "kernels/numbers/so3.hpp"

namespace tangere::kernels {

namespace detail {
inline constexpr int kArcTerms = 20;

/// A and e above, as functions of r.
template <class N>
struct ArcFactors {
  N a, e;
};
template <class N>
ArcFactors<N> arc_factors(const N& r) {
  const N inverse = 1.0 / (1.0 + sqrt(1.0 + r));
  const N r2 = r * inverse * inverse;
  const auto coefficient = [](int k) { return (k % 2 == 0 ? 1.0 : -1.0) / (2 * k + 3); };
  N b2 = N(coefficient(kArcTerms - 1));
  for (int k = kArcTerms - 2; k >= 0; --k) b2 = mul_add(b2, r2, N(coefficient(k)));
  const N a = 2.0 * (1.0 - r2 * b2) * inverse;
  const N b = (inverse + 2.0 * b2 * inverse * inverse) * inverse;
  return {a, (a + b) / (16.0 * a * a)};
}
}  // namespace detail

/// φ = log q, with what its inverse Jacobians need.
template <class N>
struct RotationVector {
  Vec3<N> phi;
  N e;
  N e1;  ///< 2 de/d|φ|²; zero unless requested
};

template <bool Slope, class N>
RotationVector<N> rotation_vector(const Quat<N>& q) {
  const N sign = select(q.w < N(0.0), N(-1.0), N(1.0));
  const N scale = sign / (1.0 + sign * q.w);
  const Vec3<N> m = {scale * q.x, scale * q.y, scale * q.z};
  const N r = dot(m, m);
  if constexpr (Slope) {  // t = |φ|² = 16 A² r
    const detail::ArcFactors<Dual<N>> f = detail::arc_factors(Dual<N>(r, N(1.0)));
    const N& a = f.a.value;
    const N dt = 16.0 * a * (a + 2.0 * r * f.a.epsilon);
    return {(4.0 * a) * m, f.e.value, 2.0 * f.e.epsilon / dt};
  } else {
    const detail::ArcFactors<N> f = detail::arc_factors(r);
    return {(4.0 * f.a) * m, f.e, N(0.0)};
  }
}

/// J_r⁻¹(φ): log(q exp δ) = φ + J_r⁻¹(φ) δ.
template <class N>
Mat3<N> inverse_right_jacobian(const RotationVector<N>& v) {
  return skew_polynomial(v.phi, N(1.0), N(0.5), v.e);
}
/// J_r⁻ᵀ(φ) = J_l⁻¹(φ): log(exp(δ) q) = φ + J_l⁻¹(φ) δ.
template <class N>
Mat3<N> inverse_left_jacobian(const RotationVector<N>& v) {
  return skew_polynomial(v.phi, N(1.0), N(-0.5), v.e);
}
/// ∂(J_r⁻ᵀ(φ) f)/∂φ = [f]/2 + e₁ (φ×(φ×f)) φᵀ - e([φ×f] + [φ][f]).
template <class N>
Mat3<N> inverse_left_jacobian_derivative(const RotationVector<N>& v, const Vec3<N>& f) {
  const Vec3<N> turned = cross(v.phi, f);
  return N(0.5) * skew(f) + outer(v.e1 * cross(v.phi, turned), v.phi) -
         v.e * (skew(turned) + cross_columns(v.phi, skew(f)));
}

}  // namespace tangere::kernels
