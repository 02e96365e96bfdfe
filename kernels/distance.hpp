// SPDX-License-Identifier: Apache-2.0
// Signed distances of primitive shapes, with gradient and Hessian, over any number type.
// d < 0 inside; n = ∇d is a unit vector everywhere, chosen where the distance has a kink (centre, edges, corners).
#pragma once

#include "kernels/inverse_sqrt.hpp"
#include "kernels/linalg.hpp"

namespace tangere::kernels {

/// Value and gradient. Curvature κ comes apart: H = κ (I - n nᵀ), which holds for spheres and (κ = 0) for flat faces.
template <class N>
struct Distance {
  N d;
  Vec3<N> n;
};

/// Sphere of radius r at the origin: d = |y| - r, H = (I - n nᵀ)/|y|. At the centre: n = z, H = 0.
template <class N>
struct SphereDistance {
  static constexpr bool kFlat = false;
  N radius;

  Distance<N> evaluate(const Vec3<N>& y, N& curvature) const {
    const N square = dot(y, y);
    const N inverse = inverse_sqrt(square);
    const N length = root_of(square, inverse);
    const auto regular = square > N(1e-300);
    const N zero(0.0);
    curvature = select(regular, inverse, zero);
    return {length - radius, {select(regular, inverse * y.x, zero), select(regular, inverse * y.y, zero),
                              select(regular, inverse * y.z, N(1.0))}};
  }
};

/// Whether the distance at y is below m > 0, without a root.
template <class N>
auto nearer_than(const SphereDistance<N>& shape, const Vec3<N>& y, const N& m) {
  const N reach = shape.radius + m;
  return dot(y, y) < reach * reach;
}

/// Cuboid with half edges s. Inside: the nearest face (the first of x, y, z on ties, outward where y_k = 0 is +).
/// Outside: the distance to the nearest face, edge or corner. H = 0 inside, the only place where contact looks.
template <class N>
struct CuboidDistance {
  static constexpr bool kFlat = true;
  Vec3<N> half;

  Distance<N> evaluate(const Vec3<N>& y, N& curvature) const {
    const N zero(0.0), one(1.0);
    curvature = zero;
    const Vec3<N> q = {abs(y.x) - half.x, abs(y.y) - half.y, abs(y.z) - half.z};
    const Vec3<N> sign = {select(y.x < zero, -one, one), select(y.y < zero, -one, one), select(y.z < zero, -one, one)};
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
            {sign.x * select(outside, inverse * out.x, pick_x), sign.y * select(outside, inverse * out.y, pick_y),
             sign.z * select(outside, inverse * out.z, pick_z)}};
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

}  // namespace tangere::kernels
