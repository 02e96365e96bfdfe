// SPDX-License-Identifier: Apache-2.0
// What cylinders and capsules have in common: how their surface stretches, and their form under a
// pad.
#pragma once

#include "kernels/contact/shapes/shape.hpp"

namespace tangere::kernels {

/// Returns where a point fixed to a rod's surface goes when the rod's size changes. `z_axis`: z of
/// the nearest point of the axis (for a cylinder, of the point itself).
template <class N>
Vec3<N> stretched_rod(const Vec3<N>& to, const Vec3<double>& from, const Vec3<double>& y,
                      double z_axis) {
  return {N(y.x / from.x) * to.x, N(y.y / from.x) * to.x,
          N((y.z - z_axis) / from.x) * to.x + N(z_axis / from.y) * to.y};
}
template <class N>
Vec3<N> rod_stretch_share(const Vec3<double>& size, const Vec3<N>& y, const Vec3<N>& bar,
                          const N& z_axis) {
  const N around = mul_add(bar.x, y.x, bar.y * y.y);
  return {mul_add(bar.z, y.z - z_axis, around) * N(1 / size.x), bar.z * z_axis * N(1 / size.y),
          N(0.0)};
}

/// What cylinders and capsules have in common under a pad: offsets and the distance from the axis.
template <class P>
struct RodPad {
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr bool kTurns = true;

  Mat3<N> Q;
  N radius, half, inverse_diameter;
  N x0, y0;  ///< y_x, y_y
  Vec3<N> u;

  RodPad(const TouchShape& s, const Mat3<N>& pose)
      : Q(pose), radius(s.size[0]), half(s.size[1]), inverse_diameter(0.5 / s.size[0]) {}

  template <class D>
  static Vec3<D> centre(const Touch<D>& at, const Vec3<D>& t) {
    return transposed_times(at.Q, t - at.c);
  }

  Vec3<N> offset(const Offset& s) const {
    return {along(Q.m[0][0], Q.m[1][0], Q.m[2][0], s), along(Q.m[0][1], Q.m[1][1], Q.m[2][1], s),
            along(Q.m[0][2], Q.m[1][2], Q.m[2][2], s)};
  }

  /// e_x(e_x + 2 y_x) + e_y(e_y + 2 y_y) + rest.
  N surplus(const Vec3<N>& e, const N& rest) const {
    return mul_add(e.x, e.x + (x0 + x0), mul_add(e.y, e.y + (y0 + y0), rest));
  }

  /// Returns |D| - r from |D|². Single precision adds one Newton step on |D|² - r², which does not
  /// cancel (as in SpherePad).
  N beyond_radius(const N& square, const N& inverse, const N& excess) const {
    const N length = square * inverse, rounded = length - radius;
    if constexpr (P::kSingle) {
      return mul_add(mul_sub_from(rounded, length + radius, excess), inverse_diameter, rounded);
    } else {
      return rounded;
    }
  }
  /// Whether D is long enough to give a direction. On the axis the direction is the shape's x.
  static auto regular(const N& square) { return square > N(P::kSmallest * P::kSmallest); }
};

}  // namespace tangere::kernels
