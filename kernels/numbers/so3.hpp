// SPDX-License-Identifier: Apache-2.0
// Rotations in a chart re-centred at every step: R = R_c exp([x]), |x| < π.
//
//   exp = I + sX + bX²,  J_r = I - bX + cX²,  X = [x],  t = |x|²
//   s, b, c = Σ_k (-1)^k t^k / (2k + o)!,  o = 1, 2, 3
//       (power series: no branch, no root, no loss near 0)
//   D(x, w) = ∂(J_r(x) w)/∂x = b[w] + (c₁ x×(x×w) - b₁ x×w) xᵀ - c([x×w] + [x][w]),
//       b₁ = 2 db/dt, c₁ = 2 dc/dt
//
// Fourteen terms reach rounding for |x| ≤ π; the closed forms lose all digits near 0.
#pragma once

#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

template <class N>
struct Quat {  // unit, w x y z
  N w, x, y, z;
};

/// The series above and their derivatives, at one rotation vector.
template <class N>
struct RotationSeries {
  N s, b, c, b1, c1;
};

namespace detail {
inline constexpr int kSeriesTerms = 14;
/// (-1)^k / (2k + offset)!
constexpr double series_coefficient(int k, int offset) {
  double f = 1;
  for (int i = 2; i <= 2 * k + offset; ++i) f *= i;
  return (k % 2 == 0 ? 1.0 : -1.0) / f;
}
template <int Offset>
struct SeriesTable {
  double value[kSeriesTerms];
  constexpr SeriesTable() : value{} {
    for (int k = 0; k < kSeriesTerms; ++k) value[k] = series_coefficient(k, Offset);
  }
};
template <int Offset>
inline constexpr SeriesTable<Offset> kSeries{};

template <int Offset, class N>
N series(const N& t) {
  N sum = N(kSeries<Offset>.value[kSeriesTerms - 1]);
  for (int k = kSeriesTerms - 2; k >= 0; --k) sum = mul_add(sum, t, N(kSeries<Offset>.value[k]));
  return sum;
}
/// d(series)/dt.
template <int Offset, class N>
N series_slope(const N& t) {
  N sum = N((kSeriesTerms - 1) * kSeries<Offset>.value[kSeriesTerms - 1]);
  for (int k = kSeriesTerms - 2; k >= 1; --k)
    sum = mul_add(sum, t, N(k * kSeries<Offset>.value[k]));
  return sum;
}
}  // namespace detail

template <class N>
RotationSeries<N> rotation_series(const Vec3<N>& x) {
  const N t = dot(x, x);
  return {detail::series<1>(t), detail::series<2>(t), detail::series<3>(t),
          2.0 * detail::series_slope<2>(t), 2.0 * detail::series_slope<3>(t)};
}

/// α I + β X + γ X², X² = x xᵀ - t I.
template <class N>
Mat3<N> skew_polynomial(const Vec3<N>& x, const N& alpha, const N& beta, const N& gamma) {
  const N t = dot(x, x);
  const N d = mul_sub_from(gamma, t, alpha);
  const Vec3<N> g = gamma * x;
  const Vec3<N> b = beta * x;
  return {{{mul_add(g.x, x.x, d), mul_add(g.x, x.y, -b.z), mul_add(g.x, x.z, b.y)},
           {mul_add(g.y, x.x, b.z), mul_add(g.y, x.y, d), mul_add(g.y, x.z, -b.x)},
           {mul_add(g.z, x.x, -b.y), mul_add(g.z, x.y, b.x), mul_add(g.z, x.z, d)}}};
}
template <class N>
Mat3<N> rotation_exp(const Vec3<N>& x, const RotationSeries<N>& k) {
  return skew_polynomial(x, N(1.0), k.s, k.b);
}
/// Right Jacobian: body angular velocity ω = J_r(x) ẋ.
template <class N>
Mat3<N> right_jacobian(const Vec3<N>& x, const RotationSeries<N>& k) {
  return skew_polynomial(x, N(1.0), -k.b, k.c);
}
/// ∂(J_r(x) w)/∂x.
template <class N>
Mat3<N> right_jacobian_derivative(const Vec3<N>& x, const RotationSeries<N>& k, const Vec3<N>& w) {
  const Vec3<N> xw = cross(x, w);
  const Vec3<N> g = k.c1 * cross(x, xw) - k.b1 * xw;
  return k.b * skew(w) + outer(g, x) - k.c * (skew(xw) + cross_columns(x, skew(w)));
}

/// Brings the angle of a revolute joint into [-π, π], where the series holds. 2π is split in two
/// parts (Cody and Waite).
template <class N>
N reduce_angle(const N& q) {
  const N turns = round_nearest(N(0.15915494309189535) * q);
  return mul_sub_from(turns, N(2.4492935982947064e-16),
                      mul_sub_from(turns, N(6.283185307179586), q));
}

template <class N>
Mat3<N> to_matrix(const Quat<N>& q) {
  const N xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
  const N xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
  const N wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
  return {{{1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy)},
           {2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx)},
           {2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy)}}};
}
template <class N>
Quat<N> conjugate(const Quat<N>& q) {
  return {q.w, -q.x, -q.y, -q.z};
}
template <class N>
Quat<N> operator*(const Quat<N>& a, const Quat<N>& b) {
  return {
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
/// Returns (cos(|x|/2), sin(|x|/2) x/|x|), by the same series at x/2.
template <class N>
Quat<N> quaternion_exp(const Vec3<N>& x) {
  const N quarter = 0.25 * dot(x, x);
  // cos θ = 1 - θ² b(θ²), θ = |x|/2.
  const N w = mul_sub_from(quarter, detail::series<2>(quarter), N(1.0));
  const Vec3<N> u = (0.5 * detail::series<1>(quarter)) * x;
  return {w, u.x, u.y, u.z};
}
/// Returns q ⊗ exp(x), normalised: a unit quaternion stays one over any number of steps.
template <class N>
Quat<N> rotate_by(const Quat<N>& q, const Vec3<N>& x) {
  const Quat<N> r = q * quaternion_exp(x);
  const N scale = 1.0 / sqrt(r.w * r.w + r.x * r.x + r.y * r.y + r.z * r.z);
  return {scale * r.w, scale * r.x, scale * r.y, scale * r.z};
}

}  // namespace tangere::kernels
