// SPDX-License-Identifier: Apache-2.0
// Signed distances of primitive shapes, with gradient and Hessian, over any number type.
// d < 0 inside; n = ∇d is a unit vector everywhere, chosen where the distance has a kink (centre,
// axis, edge, corner).
#pragma once

#include "kernels/contact/contact_types.hpp"
#include "kernels/numbers/inverse_sqrt.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

/// Value and gradient. Curvature comes apart, as one number κ.
template <class N>
struct Distance {
  N d;
  Vec3<N> n;
};

/// What the Hessian is inside a shape, the only place where contact looks.
enum class Bending {
  flat,  ///< H = 0
  ball,  ///< H = κ (I - n nᵀ), and the shape looks the same from every side: it needs no
         ///< orientation
  rod,  ///< H = κ (I - n nᵀ - e z zᵀ), z the shape's axis; e = 1 where the surface is straight
        ///< along z, else 0
};

/// Sphere of radius r at the origin: d = |y| - r, H = (I - n nᵀ)/|y|. At the centre: n = z, H = 0.
template <class N>
struct SphereDistance {
  static constexpr Bending kBending = Bending::ball;
  N radius;

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
};

/// Whether the distance at y is below m > 0, without a root.
template <class N>
auto nearer_than(const SphereDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const N reach = shape.radius + m;
  return dot(y, y) < reach * reach;
}

/// Cuboid with half edges s. Inside: the nearest face (the first of x, y, z on ties, outward where
/// y_k = 0 is +). Outside: the distance to the nearest face, edge or corner. H = 0 inside, the only
/// place where contact looks.
template <class N>
struct CuboidDistance {
  static constexpr Bending kBending = Bending::flat;
  Vec3<N> half;

  Distance<N> evaluate(const Vec3<N>& y, N& curvature) const {
    const N zero(0.0), one(1.0);
    curvature = zero;
    const Vec3<N> q = {abs(y.x) - half.x, abs(y.y) - half.y, abs(y.z) - half.z};
    const Vec3<N> sign = {select(y.x < zero, -one, one), select(y.y < zero, -one, one),
                          select(y.z < zero, -one, one)};
    const auto x_first = (q.x >= q.y) & (q.x >= q.z);
    const auto y_first = q.y >= q.z;
    const N largest = select(x_first, q.x, select(y_first, q.y, q.z));
    const N pick_x = select(x_first, one, zero);
    const N pick_y = select(x_first, zero, select(y_first, one, zero));
    const N pick_z = one - pick_x - pick_y;
    const Vec3<N> out = {max(q.x, zero), max(q.y, zero), max(q.z, zero)};
    const N square = dot(out, out);
    const N inverse = inverse_sqrt(square);
    const N length = root_of(square, inverse);
    const auto outside = square > zero;
    return {select(outside, length, largest),
            {sign.x * select(outside, inverse * out.x, pick_x),
             sign.y * select(outside, inverse * out.y, pick_y),
             sign.z * select(outside, inverse * out.z, pick_z)}};
  }

  /// The same where d < 0; elsewhere some d ≥ 0 and a unit vector, without a root.
  Distance<N> inside(const Vec3<N>& y, N& curvature) const {
    const N zero(0.0), one(1.0);
    curvature = zero;
    const Vec3<N> q = {abs(y.x) - half.x, abs(y.y) - half.y, abs(y.z) - half.z};
    const auto x_first = (q.x >= q.y) & (q.x >= q.z);
    const auto y_first = q.y >= q.z;
    const Vec3<N> sign = {select(y.x < zero, -one, one), select(y.y < zero, -one, one),
                          select(y.z < zero, -one, one)};
    return {select(x_first, q.x, select(y_first, q.y, q.z)),
            {select(x_first, sign.x, zero), select(x_first, zero, select(y_first, sign.y, zero)),
             select(x_first, zero, select(y_first, zero, sign.z))}};
  }

  /// Inside: by half edges, from a cotangent ρ of the shape's place. A face moves along its normal.
  Vec3<N> size_share(const Vec3<N>&, const Vec3<N>& n, const Vec3<N>& rho) const {
    return {n.x * rho.x, n.y * rho.y, n.z * rho.z};
  }

  /// H = (P - n nᵀ)/d outside, P the axes on which the point lies beyond its face; 0 inside.
  Mat3<N> hessian(const Vec3<N>& y) const {
    const N zero(0.0), one(1.0);
    N unused;
    const Distance<N> at = evaluate(y, unused);
    const auto outside = at.d > zero;
    const N inverse = select(outside, one / select(outside, at.d, one), zero);
    Mat3<N> h = (-inverse) * outer(at.n, at.n);
    h.m[0][0] += select(abs(y.x) > half.x, inverse, zero);
    h.m[1][1] += select(abs(y.y) > half.y, inverse, zero);
    h.m[2][2] += select(abs(y.z) > half.z, inverse, zero);
    return h;
  }
};

template <class N>
auto nearer_than(const CuboidDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const N zero(0.0);
  const Vec3<N> out = {max(abs(y.x) - shape.half.x, zero), max(abs(y.y) - shape.half.y, zero),
                       max(abs(y.z) - shape.half.z, zero)};
  return dot(out, out) < m * m;
}

/// Beyond this distance from a half-space's origin there is nothing [m]: what fills up candidate
/// lists lies at 1e6 m and must not touch it.
inline constexpr double kPlaneReach = 5e5;

/// The half-space z < 0: d = z, n = z, H = 0.
template <class N>
struct PlaneDistance {
  static constexpr Bending kBending = Bending::flat;

  Distance<N> evaluate(const Vec3<N>& y, N& curvature) const {
    const N zero(0.0);
    curvature = zero;
    const N beyond(kPlaneReach);
    return {select(dot(y, y) < beyond * beyond, y.z, beyond), {zero, zero, N(1.0)}};
  }
  Distance<N> inside(const Vec3<N>& y, N& curvature) const { return evaluate(y, curvature); }
  Vec3<N> size_share(const Vec3<N>&, const Vec3<N>&, const Vec3<N>&) const { return zero3<N>(); }
  Mat3<N> hessian(const Vec3<N>&) const { return zero33<N>(); }
};

template <class N>
auto nearer_than(const PlaneDistance<N>&, const Vec3<N>& y, const N& m) {
  const N beyond(kPlaneReach);
  return (y.z < m) & (dot(y, y) < beyond * beyond);
}

/// Distance from the z axis and the direction away from it; on the axis, x.
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

/// Cylinder with caps: radius r, half length h along z. With a = ρ - r and b = |z| - h, d = max(a,
/// b) inside (the side on ties) and |max((a, b), 0)| outside, where the rim is nearest when both
/// are positive. z = 0 counts as above.
template <class N>
struct CylinderDistance {
  static constexpr Bending kBending = Bending::rod;
  N radius, half;

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

  /// False where d ≥ 0 for certain, without a root.
  auto may_hold(const Vec3<N>& y) const -> decltype(y.x < y.y) {
    const N slack(1 + 1e-12);
    return (mul_add(y.x, y.x, y.y * y.y) < slack * (radius * radius)) & (abs(y.z) < half);
  }
  /// The same as evaluate() where d < 0; elsewhere some d ≥ 0 and a unit vector.
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

  /// Inside: by radius and half length, from a cotangent ρ of the shape's place (n is radial or
  /// axial).
  Vec3<N> size_share(const Vec3<N>&, const Vec3<N>& n, const Vec3<N>& rho) const {
    return {mul_add(n.x, rho.x, n.y * rho.y), n.z * rho.z, N(0.0)};
  }

  /// H = (n_ρ/ρ) t tᵀ, t the direction around the axis; outside the rim, 1/d across it as well.
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

/// Without a root; at the rim, true as well for some points up to √2 m away.
template <class N>
auto nearer_than(const CylinderDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const N reach = shape.radius + m;
  return (mul_add(y.x, y.x, y.y * y.y) < reach * reach) & (abs(y.z) < shape.half + m);
}

/// Capsule: all points within r of the segment |z| ≤ h. D = y - (nearest point of the segment), d =
/// |D| - r, H = (I - n nᵀ - e z zᵀ)/|D| with e = 1 beside the segment. On the segment: n = x, H =
/// 0.
template <class N>
struct CapsuleDistance {
  static constexpr Bending kBending = Bending::rod;
  N radius, half;

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

  /// By radius and half length, from a cotangent ρ of the shape's place: beyond an end that half
  /// ball moves with it.
  Vec3<N> size_share(const Vec3<N>& y, const Vec3<N>& n, const Vec3<N>& rho) const {
    const N zero(0.0);
    return {dot(n, rho), select(y.z > half, rho.z, select(y.z < -half, -rho.z, zero)), zero};
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

/// Calls f with the distance of a shape; `size` as in PairContact.
template <class N, class F>
auto with_distance(PrimitiveShape shape, const Vec3<N>& size, const F& f) {
  switch (shape) {
    case PrimitiveShape::sphere: return f(SphereDistance<N>{size.x});
    case PrimitiveShape::plane: return f(PlaneDistance<N>{});
    case PrimitiveShape::cylinder: return f(CylinderDistance<N>{size.x, size.y});
    case PrimitiveShape::capsule: return f(CapsuleDistance<N>{size.x, size.y});
    case PrimitiveShape::cuboid: break;
  }
  return f(CuboidDistance<N>{size});
}
/// The same size in every lane.
template <class N, class F>
requires(!std::is_same_v<N, double>) auto with_distance(PrimitiveShape shape,
                                                        const Vec3<double>& size, const F& f) {
  return with_distance<N>(shape, broadcast<N>(size), f);
}

/// Value and gradient alone.
template <class Shape, class N>
Distance<N> distance_at(const Shape& shape, const Vec3<N>& y) {
  N curvature, straight;
  if constexpr (Shape::kBending == Bending::rod) {
    return shape.evaluate(y, curvature, straight);
  } else {
    return shape.evaluate(y, curvature);
  }
}

}  // namespace tangere::kernels
