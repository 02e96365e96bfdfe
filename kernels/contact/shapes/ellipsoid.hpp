// SPDX-License-Identifier: Apache-2.0
// An ellipsoid with semi-axes a along its axes. The distance is exact, because contact needs
// |n| = 1 and the nearest point of the surface itself. A first-order distance has neither.
//
// The nearest point is x = a² y / (w + a² - c²), c the shortest semi-axis, where w > 0 solves
//   S(w) = Σ u² = 1,  u = a |y| / (w + a² - c²)
// S falls and is convex. 1/√S is concave and nearly straight, so Newton's method on it rises to the
// root from below. Every term is at most 1 and no divisor is less than w, which gives the bounds
//   max(a |y| - a² + c²) ≤ w ≤ |a y|
// Geometric bisection comes first where the bounds are more than a factor of 2 apart: near the
// middle plane of the shortest axis, where the two nearest points meet, they are many orders of
// magnitude apart. A lane that has converged keeps its value while others iterate, so its bits do
// not depend on them. Near the surface of an egg there are 0 or 1 bisections and 3 steps of
// Newton's method. With h the distance of the tangent plane from the centre,
//   n = g/|g|, g = y / (w + a² - c²);  h = |a n|;  d = n·y - h
// d is the largest of n·y - h over all unit n. An error of n enters squared, and only downwards.
//   κ₁ + κ₂ = h (Σ A - n·A n), κ₁ κ₂ = h⁴/(a b c)², A = diag(1/a²): curvatures of the surface at x
//   H = (h P A P + d κ₁κ₂ P) / (1 + d (κ₁ + κ₂) + d² κ₁κ₂), P = I - n nᵀ
// For the derivative by a_i at fixed y, ∂d/∂a_i = -n_i x_i/a_i, and d and n change as if the shape
// moved by
//   (x_i/a_i)(2 e_i - (x_i/a_i²) x),  x = a² n / h
#pragma once

#include "kernels/contact/shapes/general_pad.hpp"

namespace tangere::kernels {

template <class N>
struct EllipsoidDistance {
  static constexpr Bending kBending = Bending::general;
  static constexpr PrimitiveShape kShape = PrimitiveShape::ellipsoid;
  static constexpr PointSumForm kSums = PointSumForm::points;
  template <class P>
  using Pad = GeneralPad<P, EllipsoidDistance>;
  static constexpr int kBisections = 8, kNewtonSteps = 6;
  static constexpr double kNearlySolved = 1e-8;  // of S - 1 before the last step
  Vec3<N> axes;

  static EllipsoidDistance of(const Vec3<N>& size) { return {size}; }

  Distance<N> evaluate(const Vec3<N>& y) const {
    const N zero(0.0), one(1.0), least = min(axes.x, min(axes.y, axes.z));
    // On the middle plane of the shortest axis, y is moved outward, towards +, by an unmeasurable
    // amount.
    const N tiny = N(1e-30) * least;
    const N z_off = select(axes.z <= least, tiny, zero);
    const N y_off = select(axes.z <= least, zero, select(axes.y <= least, tiny, zero));
    const N x_off = select(min(axes.y, axes.z) <= least, zero, tiny);
    const Vec3<N> off = {max(abs(y.x), x_off), max(abs(y.y), y_off), max(abs(y.z), z_off)};
    const auto beyond = [&](const N& a) { return (a - least) * (a + least); };
    const Vec3<N> over = {beyond(axes.x), beyond(axes.y), beyond(axes.z)};
    const Vec3<N> reach = {axes.x * off.x, axes.y * off.y, axes.z * off.z};
    const auto quotient = [&](const Vec3<N>& of, const N& w) {
      return Vec3<N>{of.x / (w + over.x), of.y / (w + over.y), of.z / (w + over.z)};
    };
    N low = max(reach.x - over.x, max(reach.y - over.y, reach.z - over.z));
    N high = root(dot(reach, reach));
    for (int k = 0; k < kBisections; ++k) {
      const auto apart = high > low + low;
      if (!any(apart)) break;
      const N middle = root(low * high);
      const Vec3<N> u = quotient(reach, middle);
      const auto below = dot(u, u) > one;
      low = select(apart, select(below, middle, low), low);
      high = select(apart, select(below, high, middle), high);
    }
    auto searching = low < low + one;
    for (int k = 0; k < kNewtonSteps && any(searching); ++k) {
      const Vec3<N> by = quotient({one, one, one}, low);
      const Vec3<N> u = {reach.x * by.x, reach.y * by.y, reach.z * by.z};
      const N S = dot(u, u);
      const N fall = mul_add(u.x * u.x, by.x, mul_add(u.y * u.y, by.y, u.z * u.z * by.z));
      low = select(searching, low + S * (root(S) - one) / fall, low);
      searching = searching & (S > N(1 + kNearlySolved));  // the step squared the error
    }
    const Vec3<N> g = quotient(off, low);
    const N inverse = inverse_sqrt(dot(g, g));
    const auto outward = [&](const N& g_k, const N& y_k) {
      return select(y_k < zero, -(inverse * g_k), inverse * g_k);
    };
    const Vec3<N> n = {outward(g.x, y.x), outward(g.y, y.y), outward(g.z, y.z)};
    return {dot(n, y) - support(n), n};
  }

  /// Returns H as well.
  Distance<N> evaluate(const Vec3<N>& y, Mat3<N>& H) const {
    const Distance<N> at = evaluate(y);
    H = hessian(at);
    return at;
  }

  /// Returns H at a distance and its normal.
  Mat3<N> hessian(const Distance<N>& at) const {
    const Vec3<N>& n = at.n;
    const N one(1.0), h = support(n);
    const N A[3] = {one / (axes.x * axes.x), one / (axes.y * axes.y), one / (axes.z * axes.z)};
    const N components[3] = {n.x, n.y, n.z};
    const N along = mul_add(A[0] * n.x, n.x, mul_add(A[1] * n.y, n.y, A[2] * n.z * n.z));
    const N mean = h * (A[0] + A[1] + A[2] - along);
    const N gauss = (h * h) * (h * h) * (A[0] * A[1] * A[2]);
    const N spread = mul_add(at.d, mul_add(at.d, gauss, mean), one);
    const N inverse = one / max(spread, N(1e-12));  // 0 at centres of curvature
    const N of_A = h * inverse, of_P = at.d * gauss * inverse;
    Mat3<N> H;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const N outer = components[i] * components[j];
        const N own = i == j ? mul_add(of_A, A[i], of_P) : N(0.0);
        H.m[i][j] = own - outer * mul_add(of_A, A[i] + A[j] - along, of_P);
      }
    return H;
  }

  /// Cotangents of the semi-axes, from a cotangent ρ of the shape's place.
  Vec3<N> size_share(const Vec3<N>&, const Vec3<N>& n, const Vec3<N>& rho) const {
    const N inverse = N(1.0) / support(n);
    // x_i/a_i, and x·ρ divided by the a_i: x_i = a_i s_i.
    const Vec3<N> s = {inverse * axes.x * n.x, inverse * axes.y * n.y, inverse * axes.z * n.z};
    const N along =
        mul_add(axes.x * s.x, rho.x, mul_add(axes.y * s.y, rho.y, axes.z * s.z * rho.z));
    const auto share = [&](const N& s_i, const N& a, const N& rho_i) {
      return s_i * (rho_i + rho_i - s_i / a * along);
    };
    return {share(s.x, axes.x, rho.x), share(s.y, axes.y, rho.y), share(s.z, axes.z, rho.z)};
  }

  static Vec3<N> stretched(const Vec3<N>& to, const Vec3<double>& from, const Vec3<double>& y) {
    return stretched_along_axes(to, from, y);
  }
  static Vec3<N> stretch_share(const Vec3<double>& size, const Vec3<N>& y, const Vec3<N>& bar) {
    return axes_stretch_share(size, y, bar);
  }

 private:
  static N root(const N& x) { return root_of(x, inverse_sqrt(x)); }
  /// Returns the distance from the centre to the tangent plane with normal n.
  N support(const Vec3<N>& n) const {
    const Vec3<N> a = {axes.x * n.x, axes.y * n.y, axes.z * n.z};
    return root(dot(a, a));
  }
};

/// Points nearer than m lie in the box with half edges a + m, and in the ellipsoid whose tangent
/// planes are at h' with h'² = (1 + m/c) h² + (1 + c/m) m² ≥ (h + m)².
template <class N>
auto nearer_than(const EllipsoidDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const Vec3<N>& a = shape.axes;
  const N least = min(a.x, min(a.y, a.z)), grow = N(1.0) + m / least, rest = m * (m + least);
  const auto part = [&](const N& y_k, const N& a_k) {
    return y_k * y_k / mul_add(grow, a_k * a_k, rest);
  };
  return (part(y.x, a.x) + part(y.y, a.y) + part(y.z, a.z) < N(1 + 1e-12)) & (abs(y.x) < a.x + m) &
         (abs(y.y) < a.y + m) & (abs(y.z) < a.z + m);
}

}  // namespace tangere::kernels
