// SPDX-License-Identifier: Apache-2.0
// A ball of radius r about the origin.
#pragma once

#include "kernels/contact/shapes/shape.hpp"

namespace tangere::kernels {

template <class P>
struct SpherePad;

/// Sphere of radius r at the origin: d = |y| - r, H = (I - n nᵀ)/|y|. At the centre: n = z, H = 0.
template <class N>
struct SphereDistance {
  static constexpr Bending kBending = Bending::ball;
  static constexpr PrimitiveShape kShape = PrimitiveShape::sphere;
  static constexpr PointSumForm kSums = PointSumForm::about_centre;
  template <class P>
  using Pad = SpherePad<P>;
  N radius;

  static SphereDistance of(const Vec3<N>& size) { return {size.x}; }

  Distance<N> evaluate(const Vec3<N>& y, N& curvature) const {
    const N square = dot(y, y);
    const N inverse = inverse_sqrt(square);
    const N length = root_of(square, inverse);
    const auto regular = square > N(1e-300);
    const N zero(0.0);
    curvature = select(regular, inverse, zero);
    return {length - radius,
            {select(regular, inverse * y.x, zero), select(regular, inverse * y.y, zero),
             select(regular, inverse * y.z, N(1.0))}};
  }

  Mat3<N> hessian(const Vec3<N>& y) const {
    N curvature;
    const Distance<N> at = evaluate(y, curvature);
    return curvature * (diagonal(N(1.0)) - outer(at.n, at.n));
  }

  /// Cotangent of the radius, from a cotangent ρ of the sphere's place, in any axes.
  Vec3<N> size_share(const Vec3<N>&, const Vec3<N>& n, const Vec3<N>& rho) const {
    return {dot(n, rho), N(0.0), N(0.0)};
  }
};

/// Whether the distance at y is below m > 0. Takes no root.
template <class N>
auto nearer_than(const SphereDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const N reach = shape.radius + m;
  return dot(y, y) < reach * reach;
}

/// A ball of radius r.
template <class P>
struct SpherePad {
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr bool kTurns = false;  ///< whether its rotation matters
  static constexpr int kRows = 7;        // a, a² - r², u

  N radius, minus_radius, inverse_diameter;
  N ax, ay, az, twice_ax, twice_ay, twice_az, square_az, excess;
  Vec3<N> u;

  /// Constants of a shape. `pose` is its rotation, which a sphere ignores.
  SpherePad(const TouchShape& s, const Mat3<N>&)
      : radius(s.size[0]), minus_radius(-s.size[0]), inverse_diameter(0.5 / s.size[0]) {}

  /// Returns a negative number where the shape may reach a tile at t. `row`: its brackets, all but
  /// the velocity.
  template <class D>
  static D bracket(const TouchShape& s, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const D ax = t.x - at.c.x, ay = t.y - at.c.y, height = t.z - at.c.z;
    // z is moved off the plane by an unmeasurable distance. Then |D| is never zero, and the normal
    // at the centre is ±z.
    const D smallest(P::kSmallest);
    const D az = select(abs(height) < smallest, smallest, height);
    const D square = mul_add(ax, ax, mul_add(ay, ay, az * az));
    row[0] = ax, row[1] = ay, row[2] = az;
    row[3] = square - D(s.size[0] * s.size[0]);
    const D far = reach + D(s.size[0]);
    return square - far * far;
  }

  void set(const N* row) {
    ax = row[0], ay = row[1], az = row[2], excess = row[3];
    twice_ax = ax + ax, twice_ay = ay + ay, twice_az = az + az, square_az = az * az;
  }

  auto distance(const Offset& s, N& d, Vec3<N>& n) const {
    const N x = s.x + ax, y = s.y + ay;
    N z = az, square_z = square_az, rest = excess;
    if constexpr (P::kCurved) {
      z = s.z + az;
      square_z =
          max(z * z, N(P::kSmallest * P::kSmallest));  // at the centre the force is tangential
      rest = mul_add(s.z, s.z + twice_az, excess);
    }
    const N square = mul_add(x, x, mul_add(y, y, square_z));
    if constexpr (P::kSingle) {
      // |D| is rounded, then corrected by one Newton step on D² - r², whose value does not cancel.
      // Its slope 2|D| is taken at the surface, where |D| - r cancels. Deep inside nothing cancels.
      const N surplus = mul_add(s.x, s.x + twice_ax, mul_add(s.y, s.y + twice_ay, rest));
      const N inverse = inverse_sqrt(square);
      const N length = square * inverse, rounded = length - radius;
      d = mul_add(mul_sub_from(rounded, length + radius, surplus), inverse_diameter, rounded);
      n = {inverse * x, inverse * y, inverse * z};
      return surplus < N(0.0);
    } else {
      const N inverse = inverse_sqrt(square);
      d = mul_add(square, inverse, minus_radius);
      n = {inverse * x, inverse * y, inverse * z};
      return d < N(0.0);
    }
  }
};

}  // namespace tangere::kernels
