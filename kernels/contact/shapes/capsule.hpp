// SPDX-License-Identifier: Apache-2.0
// All points within r of a segment along z. Under a pad, the distance is taken from the nearest
// point of the axis: as for a cylinder's side, or beyond an end with z = ±h:
//   |D|² - r² = [y_x² + y_y² + (y_z ∓ h)² - r²] + e_x(…) + e_y(…) + e_z(e_z + 2 [y_z ∓ h])
#pragma once

#include "kernels/contact/shapes/rod.hpp"

namespace tangere::kernels {

template <class P>
struct CapsulePad;

/// Capsule: all points within r of the segment |z| ≤ h. D = y - (nearest point of the segment),
/// d = |D| - r, H = (I - n nᵀ - e z zᵀ)/|D| with e = 1 beside the segment. On the segment, n = x
/// and H = 0.
template <class N>
struct CapsuleDistance {
  static constexpr Bending kBending = Bending::rod;
  static constexpr PrimitiveShape kShape = PrimitiveShape::capsule;
  static constexpr PointSumForm kSums = PointSumForm::points;
  template <class P>
  using Pad = CapsulePad<P>;
  N radius, half;

  static CapsuleDistance of(const Vec3<N>& size) { return {size.x, size.y}; }

  Distance<N> evaluate(const Vec3<N>& y, N& curvature, N& straight) const {
    const N zero(0.0), one(1.0);
    const N nearest = max(min(y.z, half), -half);
    const Vec3<N> D = {y.x, y.y, y.z - nearest};
    const N square = dot(D, D);
    const N inverse = inverse_sqrt(square);
    const auto regular = square > N(1e-300);
    curvature = select(regular, inverse, zero);
    straight = select(abs(y.z) < half, one, zero);
    return {root_of(square, inverse) - radius,
            {select(regular, inverse * D.x, one), select(regular, inverse * D.y, zero),
             select(regular, inverse * D.z, zero)}};
  }

  /// Cotangents of radius and half length, from a cotangent ρ of the shape's place. Beyond an end,
  /// the half ball moves with the half length.
  Vec3<N> size_share(const Vec3<N>& y, const Vec3<N>& n, const Vec3<N>& rho) const {
    const N zero(0.0);
    return {dot(n, rho), select(y.z > half, rho.z, select(y.z < -half, -rho.z, zero)), zero};
  }

  static Vec3<N> stretched(const Vec3<N>& to, const Vec3<double>& from, const Vec3<double>& y) {
    return stretched_rod(to, from, y, max(min(y.z, from.y), -from.y));
  }
  static Vec3<N> stretch_share(const Vec3<double>& size, const Vec3<N>& y, const Vec3<N>& bar) {
    return rod_stretch_share(size, y, bar, max(min(y.z, N(size.y)), N(-size.y)));
  }

  Mat3<N> hessian(const Vec3<N>& y) const {
    N curvature, straight;
    const Distance<N> at = evaluate(y, curvature, straight);
    Mat3<N> h = diagonal(N(1.0)) - outer(at.n, at.n);
    h.m[2][2] -= straight;
    return curvature * h;
  }
};

template <class N>
auto nearer_than(const CapsuleDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const N over = max(abs(y.z) - shape.half, N(0.0)), reach = shape.radius + m;
  return mul_add(over, over, mul_add(y.x, y.x, y.y * y.y)) < reach * reach;
}

/// The brackets are explained in kernels/tactile/tactile_point.hpp.
template <class P>
struct CapsulePad : RodPad<P> {
  using Base = RodPad<P>;
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr int kRows =
      10;  // y_x, y_y, y_z - h, y_z + h, the remainders beside the axis, above it and below it, u

  N above, below, beside_rest, above_rest, below_rest;

  using Base::Base;

  template <class D>
  static D bracket(const TouchShape& s, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const D zero(0.0);
    const Vec3<D> c = Base::centre(at, t);
    const D square = mul_add(c.x, c.x, c.y * c.y), far = reach + D(s.size[0]);
    row[0] = c.x, row[1] = c.y;
    row[2] = c.z - D(s.size[1]), row[3] = c.z + D(s.size[1]);
    row[4] = square - D(s.size[0] * s.size[0]);
    row[5] = mul_add(row[2], row[2], row[4]);
    row[6] = mul_add(row[3], row[3], row[4]);
    const D over = max(row[2], zero) + min(row[3], zero);
    return mul_add(over, over, square) - far * far;
  }

  void set(const N* row) {
    this->x0 = row[0], this->y0 = row[1];
    above = row[2], below = row[3];
    beside_rest = row[4], above_rest = row[5], below_rest = row[6];
  }

  auto distance(const Offset& s, N& d, Vec3<N>& n) const {
    const N zero(0.0), one(1.0);
    const Vec3<N> e = this->offset(s);
    const N x = e.x + this->x0, y = e.y + this->y0, up = above + e.z, down = below + e.z;
    const N z = max(up, zero) + min(down, zero);  // beyond an end; 0 beside the axis
    const N square = mul_add(x, x, mul_add(y, y, z * z)), inverse = inverse_sqrt(square);
    const N end =
        select(up > zero, mul_add(e.z, e.z + (above + above), above_rest),
               select(down < zero, mul_add(e.z, e.z + (below + below), below_rest), beside_rest));
    d = this->beyond_radius(square, inverse, this->surplus(e, end));
    const auto regular = Base::regular(square);
    n = this->Q * Vec3<N>{select(regular, inverse * x, one), select(regular, inverse * y, zero),
                          select(regular, inverse * z, zero)};
    return d < zero;
  }
};

}  // namespace tangere::kernels
