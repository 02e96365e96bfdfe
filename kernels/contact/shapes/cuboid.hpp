// SPDX-License-Identifier: Apache-2.0
// A cuboid with half edges s along its axes.
#pragma once

#include "kernels/contact/shapes/shape.hpp"

namespace tangere::kernels {

template <class P>
struct CuboidPad;

/// Cuboid with half edges s. Inside, d is the distance to the nearest face (ties: the first of x,
/// y, z; at y_k = 0 outward is +). Outside, it is the distance to the nearest face, edge or corner.
/// H = 0 inside. Only ball contacts evaluate it outside (kernels/contact/ball_contact.hpp).
template <class N>
struct CuboidDistance {
  static constexpr Bending kBending = Bending::flat;
  static constexpr PrimitiveShape kShape = PrimitiveShape::cuboid;
  static constexpr PointSumForm kSums = PointSumForm::faces;
  template <class P>
  using Pad = CuboidPad<P>;
  Vec3<N> half;

  static CuboidDistance of(const Vec3<N>& size) { return {size}; }

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

  /// The same where d < 0. Elsewhere, without a root: some d ≥ 0 and a unit vector.
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

  /// Cotangents of the half edges, from a cotangent ρ of the shape's place. A face moves along its
  /// normal, and an edge with both of its faces.
  Vec3<N> size_share(const Vec3<N>&, const Vec3<N>& n, const Vec3<N>& rho) const {
    const N zero(0.0);
    const auto share = [&](const N& to, const N& by) {
      return select(to > zero, by, select(to < zero, -by, zero));
    };
    return {share(n.x, rho.x), share(n.y, rho.y), share(n.z, rho.z)};
  }

  static Vec3<N> stretched(const Vec3<N>& to, const Vec3<double>& from, const Vec3<double>& y) {
    return stretched_along_axes(to, from, y);
  }
  static Vec3<N> stretch_share(const Vec3<double>& size, const Vec3<N>& y, const Vec3<N>& bar) {
    return axes_stretch_share(size, y, bar);
  }

  /// H = (P - n nᵀ)/d outside, where P projects on the axes along which the point lies beyond its
  /// face. H = 0 inside.
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

/// A cuboid with half edges h. Forces act only inside, where d is the largest of six signed face
/// distances.
template <class P>
struct CuboidPad {
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr bool kTurns = true;
  static constexpr int kRows = 9;  // y - h, -y - h, u

  Mat3<N> Q;
  N above[3], below[3];
  Vec3<N> u;

  CuboidPad(const TouchShape&, const Mat3<N>& pose) : Q(pose) {}

  template <class D>
  static D bracket(const TouchShape& s, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const Vec3<D> centre = transposed_times(at.Q, t - at.c);
    const D c[3] = {centre.x, centre.y, centre.z};
    D gap(0.0);
    for (int k = 0; k < 3; ++k) {
      row[k] = c[k] - D(s.size[k]);
      row[3 + k] = -c[k] - D(s.size[k]);
      const D outside = max(row[k], row[3 + k]);
      gap = k == 0 ? outside : max(gap, outside);
    }
    return gap - reach;
  }

  void set(const N* row) {
    for (int k = 0; k < 3; ++k) above[k] = row[k], below[k] = row[3 + k];
  }

  auto distance(const Offset& s, N& d, Vec3<N>& n) const {
    N q[3], sign[3];
    for (int k = 0; k < 3; ++k) {
      const N offset = along(Q.m[0][k], Q.m[1][k], Q.m[2][k], s);
      const N out = above[k] + offset, back = below[k] - offset;
      q[k] = max(out, back);
      sign[k] = select(out >= back, N(1.0), N(-1.0));
    }
    const auto x_first = (q[0] >= q[1]) & (q[0] >= q[2]);  // the first of x, y, z on ties
    const auto y_first = q[1] >= q[2];
    const auto pick = [&](const N& x, const N& y, const N& z) {
      return select(x_first, x, select(y_first, y, z));
    };
    d = pick(q[0], q[1], q[2]);
    const N outward = pick(sign[0], sign[1], sign[2]);
    n = {outward * pick(Q.m[0][0], Q.m[0][1], Q.m[0][2]),
         outward * pick(Q.m[1][0], Q.m[1][1], Q.m[1][2]),
         outward * pick(Q.m[2][0], Q.m[2][1], Q.m[2][2])};
    return d < N(0.0);
  }
};

}  // namespace tangere::kernels
