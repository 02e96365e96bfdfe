// SPDX-License-Identifier: Apache-2.0
// Half-spaces, cylinders and capsules under a pad, in the shape's own axes, relative to the tile.
//
// y = Qᵀ(t - c) is the tile's centre there, e = Qᵀs the point's offset from it. Brackets, taken in
// double:
//   half-space: d = [y_z] + e_z
//   cylinder:   side as a sphere in the plane: ρ² - r² = e_x(e_x + 2 y_x) + e_y(e_y + 2 y_y) +
//       [y_x² + y_y² - r²];
//               caps: d = max([y_z - h] + e_z, [-y_z - h] - e_z)
//   capsule:    |D|² - r² about the nearest point of the axis: beside it as the cylinder's side,
//       beyond an end, z = ±h
//               [y_x² + y_y² + (y_z ∓ h)² - r²] + e_x(…) + e_y(…) + e_z(e_z + 2 [y_z ∓ h])
#pragma once

#include "kernels/tactile/tactile_point.hpp"

namespace tangere::kernels {

/// The half-space z < 0 of its frame.
template <class P>
struct PlanePad {
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr bool kTurns = true;
  static constexpr int kRows = 4;  // y_z, u
  /// Offsets beyond this are not points but what fills up edge tiles, and a half-space reaches that
  /// far [m].
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

/// What cylinders and capsules have in common: offsets and the distance from the axis.
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

  /// |D| - r, from |D|² and, in single precision, one Newton step on |D|² - r², which does not
  /// cancel (SpherePad).
  N beyond_radius(const N& square, const N& inverse, const N& excess) const {
    const N length = square * inverse, rounded = length - radius;
    if constexpr (P::kSingle) {
      return mul_add(mul_sub_from(rounded, length + radius, excess), inverse_diameter, rounded);
    } else {
      return rounded;
    }
  }
  /// Whether a direction can be told from D; on the axis it is the shape's x.
  static auto regular(const N& square) { return square > N(P::kSmallest * P::kSmallest); }
};

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

template <class P>
struct CapsulePad : RodPad<P> {
  using Base = RodPad<P>;
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr int kRows =
      10;  // y_x, y_y, y_z - h, y_z + h, the rests beside the axis, above and below it, u

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
