// SPDX-License-Identifier: Apache-2.0
// The half-space z < 0 of its frame. Under a pad: d = [y_z] + e_z.
#pragma once

#include "kernels/contact/shapes/shape.hpp"

namespace tangere::kernels {

template <class P>
struct PlanePad;

/// Nothing lies beyond this distance from a half-space's origin [m]. Filler points of candidate
/// lists lie at 1e6 m and must not touch it.
inline constexpr double kPlaneReach = 5e5;

/// The half-space z < 0: d = z, n = z, H = 0.
template <class N>
struct PlaneDistance {
  static constexpr Bending kBending = Bending::flat;
  static constexpr PrimitiveShape kShape = PrimitiveShape::plane;
  static constexpr PointSumForm kSums = PointSumForm::faces;
  template <class P>
  using Pad = PlanePad<P>;

  static PlaneDistance of(const Vec3<N>&) { return {}; }

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

/// The half-space z < 0 of its frame.
template <class P>
struct PlanePad {
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr bool kTurns = true;
  static constexpr int kRows = 4;  // y_z, u
  /// Offsets beyond this [m] are not points but fill up edge tiles. A half-space reaches that far,
  /// so they are left out.
  static constexpr double kFiller = 1e5;

  Vec3<N> normal;
  N height;
  Vec3<N> u;

  PlanePad(const TouchShape&, const Mat3<N>& pose)
      : normal{pose.m[0][2], pose.m[1][2], pose.m[2][2]} {}

  template <class D>
  static D bracket(const TouchShape&, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const Vec3<D> arm = t - at.c;
    row[0] = mul_add(at.Q.m[0][2], arm.x, mul_add(at.Q.m[1][2], arm.y, at.Q.m[2][2] * arm.z));
    return row[0] - reach;
  }

  void set(const N* row) { height = row[0]; }

  auto distance(const Offset& s, N& d, Vec3<N>& n) const {
    d = along(normal.x, normal.y, normal.z, s) + height;
    n = normal;
    return (d < N(0.0)) & (s.x < N(kFiller));
  }
};

}  // namespace tangere::kernels
