// SPDX-License-Identifier: Apache-2.0
// A cylinder with caps along z. Under a pad its side is like a sphere in the plane:
//   ρ² - r² = e_x(e_x + 2 y_x) + e_y(e_y + 2 y_y) + [y_x² + y_y² - r²]
// and its caps: d = max([y_z - h] + e_z, [-y_z - h] - e_z)
#pragma once

#include "kernels/contact/shapes/rod.hpp"

namespace tangere::kernels {

template <class P>
struct CylinderPad;

/// Distance from the z axis, and the direction away from it, which is x on the axis.
template <class N>
struct AxisDistance {
  N rho, inverse;  ///< ρ and 1/ρ; 0 and 0 on the axis
  N x, y;          ///< unit vector

  explicit AxisDistance(const Vec3<N>& p) {
    const N zero(0.0), square = mul_add(p.x, p.x, p.y * p.y);
    const N root = inverse_sqrt(square);
    const auto regular = square > N(1e-300);
    rho = root_of(square, root);
    inverse = select(regular, root, zero);
    x = select(regular, root * p.x, N(1.0));
    y = select(regular, root * p.y, zero);
  }
};

/// Cylinder with caps: radius r, half length h along z. With a = ρ - r and b = |z| - h,
/// d = max(a, b) inside (ties: the side) and |max((a, b), 0)| outside, where the rim is nearest
/// when both are positive. z = 0 counts as the upper half.
template <class N>
struct CylinderDistance {
  static constexpr Bending kBending = Bending::rod;
  static constexpr PrimitiveShape kShape = PrimitiveShape::cylinder;
  static constexpr PointSumForm kSums = PointSumForm::faces;
  template <class P>
  using Pad = CylinderPad<P>;
  N radius, half;

  static CylinderDistance of(const Vec3<N>& size) { return {size.x, size.y}; }

  Distance<N> evaluate(const Vec3<N>& y, N& curvature, N& straight) const {
    const N zero(0.0), one(1.0);
    const AxisDistance<N> axis(y);
    const N a = axis.rho - radius, b = abs(y.z) - half;
    const N up = select(y.z < zero, -one, one);
    const auto side = a >= b;
    const N out_a = max(a, zero), out_b = max(b, zero);
    const N square = mul_add(out_a, out_a, out_b * out_b);
    const N inverse = inverse_sqrt(square);
    const auto outside = square > N(1e-300);
    const N radial = select(outside, inverse * out_a, select(side, one, zero));
    const N axial = select(outside, inverse * out_b, select(side, zero, one));
    curvature = select(side, axis.inverse, zero);
    straight = one;
    return {select(outside, root_of(square, inverse), select(side, a, b)),
            {radial * axis.x, radial * axis.y, axial * up}};
  }

  /// Returns false where d ≥ 0 for certain. Takes no root.
  auto may_hold(const Vec3<N>& y) const -> decltype(y.x < y.y) {
    const N slack(1 + 1e-12);
    return (mul_add(y.x, y.x, y.y * y.y) < slack * (radius * radius)) & (abs(y.z) < half);
  }
  /// The same as evaluate() where d < 0. Elsewhere some d ≥ 0 and a unit vector.
  Distance<N> inside(const Vec3<N>& y, N& curvature) const {
    const N zero(0.0), one(1.0);
    const AxisDistance<N> axis(y);
    const N a = axis.rho - radius, b = abs(y.z) - half;
    const auto side = a >= b;
    curvature = select(side, axis.inverse, zero);
    return {select(side, a, b),
            {select(side, axis.x, zero), select(side, axis.y, zero),
             select(side, zero, select(y.z < zero, -one, one))}};
  }

  /// Cotangents of radius and half length, from a cotangent ρ of the shape's place. The rim moves
  /// with both.
  Vec3<N> size_share(const Vec3<N>& y, const Vec3<N>& n, const Vec3<N>& rho) const {
    const N zero(0.0);
    const AxisDistance<N> axis(y);
    const auto beside = mul_add(n.x, n.x, n.y * n.y) > zero;
    return {select(beside, mul_add(axis.x, rho.x, axis.y * rho.y), zero),
            select(n.z > zero, rho.z, select(n.z < zero, -rho.z, zero)), zero};
  }

  static Vec3<N> stretched(const Vec3<N>& to, const Vec3<double>& from, const Vec3<double>& y) {
    return stretched_rod(to, from, y, y.z);
  }
  static Vec3<N> stretch_share(const Vec3<double>& size, const Vec3<N>& y, const Vec3<N>& bar) {
    return rod_stretch_share(size, y, bar, y.z);
  }

  /// H = (n_ρ/ρ) t tᵀ, t the direction around the axis. Outside the rim, H also has 1/d across it.
  Mat3<N> hessian(const Vec3<N>& y) const {
    const N zero(0.0), one(1.0);
    const AxisDistance<N> axis(y);
    N unused;
    const Distance<N> at = evaluate(y, unused, unused);
    const N radial = mul_add(at.n.x, axis.x, at.n.y * axis.y);
    const Vec3<N> around = {-axis.y, axis.x, zero};
    const Vec3<N> across = {-(at.n.z * axis.x), -(at.n.z * axis.y), radial};
    const auto rim = (axis.rho > radius) & (abs(y.z) > half);
    const N bend = select(rim, one / select(rim, at.d, one), zero);
    return (radial * axis.inverse) * outer(around, around) + bend * outer(across, across);
  }
};

/// Takes no root. At the rim it is also true for some points up to √2 m away.
template <class N>
auto nearer_than(const CylinderDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const N reach = shape.radius + m;
  return (mul_add(y.x, y.x, y.y * y.y) < reach * reach) & (abs(y.z) < shape.half + m);
}

/// The brackets are explained in kernels/tactile/tactile_point.hpp.
template <class P>
struct CylinderPad : RodPad<P> {
  using Base = RodPad<P>;
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr int kRows = 8;  // y_x, y_y, y_z - h, -y_z - h, y_x² + y_y² - r², u

  N above, below, rest;

  using Base::Base;

  template <class D>
  static D bracket(const TouchShape& s, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const Vec3<D> c = Base::centre(at, t);
    const D square = mul_add(c.x, c.x, c.y * c.y), far = reach + D(s.size[0]);
    row[0] = c.x, row[1] = c.y;
    row[2] = c.z - D(s.size[1]), row[3] = -c.z - D(s.size[1]);
    row[4] = square - D(s.size[0] * s.size[0]);
    return max(square - far * far, max(row[2], row[3]) - reach);
  }

  void set(const N* row) {
    this->x0 = row[0], this->y0 = row[1];
    above = row[2], below = row[3], rest = row[4];
  }

  auto distance(const Offset& s, N& d, Vec3<N>& n) const {
    const N zero(0.0), one(1.0);
    const Vec3<N> e = this->offset(s);
    const N x = e.x + this->x0, y = e.y + this->y0, up = above + e.z, down = below - e.z;
    const N square = mul_add(x, x, y * y), inverse = inverse_sqrt(square);
    const N side = this->beyond_radius(square, inverse, this->surplus(e, rest)),
            cap = max(up, down);
    const auto on_side = side >= cap, regular = Base::regular(square);
    d = select(on_side, side, cap);
    const N nx = select(on_side, select(regular, inverse * x, one), zero);
    const N ny = select(on_side, select(regular, inverse * y, zero), zero);
    const N nz = select(on_side, zero, select(up >= down, one, zero - one));
    n = this->Q * Vec3<N>{nx, ny, nz};
    return d < zero;
  }
};

}  // namespace tangere::kernels
