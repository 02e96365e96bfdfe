// SPDX-License-Identifier: Apache-2.0
// The force on tactile points, relative to their tile, so that single precision loses nothing
// (docs/contact.md).
//
// A point is ξ = t + s, t its tile's centre, s the offset. Whatever cancels is a bracket, taken in
// double once per tile:
//   sphere: a = t - c;  D = a + s;  D² - r² = s·(s + 2a) + [a² - r²];  d = |D| - r from it
//   cuboid: y = Qᵀ(t - c);  d = max over the faces of [±y_k - h_k] ± (Qᵀs)_k
//   half-spaces, cylinders, capsules: tactile_rods.hpp
//   velocity at x₂ = ξ - d n:  u = [-(v + ω × t)] + ω × (d n - s)
// Every function acts lane by lane: lanes may be tiles or environments (brackets), points or
// environments (forces).
#pragma once

#include "kernels/numbers/inverse_sqrt.hpp"
#include "kernels/numbers/lanes_f32.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// A point from its tile's centre, pad axes [m].
template <class N, bool Curved>
struct PointOffset {
  N x, y;  ///< z = 0
};
template <class N>
struct PointOffset<N, true> {
  N x, y, z;
};
/// A row of a matrix times it: a x + b y + c z.
template <class N>
N along(const N& a, const N& b, const N&, const PointOffset<N, false>& s) {
  return mul_add(a, s.x, b * s.y);
}
template <class N>
N along(const N& a, const N& b, const N& c, const PointOffset<N, true>& s) {
  return mul_add(a, s.x, mul_add(b, s.y, c * s.z));
}

/// Double precision: eight lanes.
template <class Arch>
struct InDouble {
  using Architecture = Arch;
  using N = Lanes<Arch>;
  using Real = double;
  using Offset = PointOffset<N, false>;
  static constexpr bool kSingle = false, kCurved = false;
  static constexpr int kLanes = kGroup;
  static constexpr double kSmallest = 1e-150;  ///< its square is still a normal number
  static N load(const double* p) { return load_lanes<Arch>(p); }
  static void store(const N& x, double* p) { store_lanes(x, p); }
  static const double* offsets(const PadTiles& pad) { return pad.offsets; }
  static const double* frames(const PadTiles& pad) { return pad.frames; }
  static const double* factors(const PadTiles& pad) { return pad.factors; }
};

/// Brackets in double, sixteen points in single precision.
template <class Arch>
struct InMixed {
  using Architecture = Arch;
  using N = LanesF<Arch>;
  using Real = float;
  using Offset = PointOffset<N, false>;
  static constexpr bool kSingle = true, kCurved = false;
  static constexpr int kLanes = kLanesF;
  static constexpr double kSmallest = 1e-18;
  static N load(const float* p) { return load_lanes_f<Arch>(p); }
  static void store(const N& x, float* p) { store_lanes_f(x, p); }
  static const float* offsets(const PadTiles& pad) { return pad.offsets_f; }
  static const float* frames(const PadTiles& pad) { return pad.frames_f; }
  static const float* factors(const PadTiles& pad) { return pad.factors_f; }
};

/// The points of P on a curved pad.
template <class P>
struct OnCurvedPad : P {
  using Offset = PointOffset<typename P::N, true>;
  static constexpr bool kCurved = true;
};

/// Contact parameters and rotation as a point needs them.
template <class N>
struct PointLaw {
  Vec3<N> omega;
  N minus_kn, kt, mu, damping;
};

inline constexpr int kBracketRows = 10;  ///< the most that a shape has

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

  /// Constants of a shape; `pose` is its rotation, the same everywhere for a sphere.
  SpherePad(const TouchShape& s, const Mat3<N>&)
      : radius(s.size[0]), minus_radius(-s.size[0]), inverse_diameter(0.5 / s.size[0]) {}

  /// Negative where the shape may reach a tile at t. `row`: its brackets, all but the velocity.
  template <class D>
  static D bracket(const TouchShape& s, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const D ax = t.x - at.c.x, ay = t.y - at.c.y, height = t.z - at.c.z;
    // Off the plane by some unmeasurable distance: then |D| is never zero, and the normal at the
    // centre is ±z.
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
      // |D| rounded, then one Newton step on D² - r², whose value does not cancel. Its slope 2|D|
      // is taken at the surface, where |D| - r cancels; deep inside nothing does.
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

/// A cuboid with half edges h. Only inside do forces act: there d is the largest of six signed face
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

/// -(v + ω × t): velocity of the pad relative to the shape, both extended to the tile's centre.
template <class D>
Vec3<D> tile_velocity(const Touch<D>& at, const Vec3<D>& t) {
  return cross(t, at.omega) - at.v;
}

/// Normal force and the bound of friction over μ (contact_law.hpp; `linear` with ramp 0). d = 0
/// gives zeros.
template <ContactLaw Law, class N, class M>
void pad_normal_force(const PointLaw<N>& law, const N& d, const N& rate, const M& touching,
                      N& force, N& bound) {
  const N zero(0.0);
  if constexpr (Law == ContactLaw::linear) {
    bound = law.minus_kn * d;
    force = select(touching, max(mul_sub_from(law.damping, rate, bound), zero), zero);
  } else {
    force = mul_add(law.damping, rate, law.minus_kn) * d;
    if constexpr (Law == ContactLaw::clamped) force = max(force, zero);
    bound = Law == ContactLaw::clamped ? force : max(force, zero - force);
  }
}

/// Force on the points at offset s: (f·e0, f·e1, -f·e2) in pad axes, +0 where nothing touches.
/// False, and `force` left alone, where nothing touches in any lane.
template <class P, ContactLaw Law, class Shape, class N = typename P::N>
bool point_force(const Shape& shape, const PointLaw<N>& law, const typename P::Offset& s,
                 Vec3<N>& force) {
  N d;
  Vec3<N> n;
  const auto touching = shape.distance(s, d, n);
  if (!any(touching)) return false;
  const N zero(0.0);
  Vec3<N> arm = {mul_add(d, n.x, zero - s.x), mul_add(d, n.y, zero - s.y), d * n.z};
  if constexpr (P::kCurved) arm.z = arm.z - s.z;
  const Vec3<N>& w = law.omega;
  const Vec3<N> u = {mul_sub_from(w.z, arm.y, mul_add(w.y, arm.z, shape.u.x)),
                     mul_sub_from(w.x, arm.z, mul_add(w.z, arm.x, shape.u.y)),
                     mul_sub_from(w.y, arm.x, mul_add(w.x, arm.y, shape.u.z))};
  const N rate = dot(n, u);
  const Vec3<N> slide = {mul_sub_from(rate, n.x, u.x), mul_sub_from(rate, n.y, u.y),
                         mul_sub_from(rate, n.z, u.z)};
  N normal, bound;
  pad_normal_force<Law>(law, select(touching, d, zero), rate, touching, normal, bound);
  // Stick or slip: the smaller of k_t and μ B/|v_t|. Without sliding the second is huge, never a
  // division by zero.
  const N square = max(dot(slide, slide), N(P::kSmallest * P::kSmallest));
  const N scale = min(law.kt, law.mu * bound * inverse_sqrt(square));
  // Each sum starts from +0, so that no -0 is left where a factor is zero.
  force = {mul_add(normal, n.x, mul_sub_from(scale, slide.x, zero)),
           mul_add(normal, n.y, mul_sub_from(scale, slide.y, zero)),
           mul_sub_from(normal, n.z, mul_add(scale, slide.z, zero))};
  return true;
}

/// Coefficients of points that have factors of their own; `factors` (4, 64).
template <class P, class N = typename P::N>
PointLaw<N> scaled_law(const PointLaw<N>& law, const typename P::Real* factors) {
  const auto factor = [&](int k) { return P::load(factors + k * kTactileTile); };
  return {law.omega, law.minus_kn * factor(0), law.kt * factor(1), law.mu * factor(2),
          law.damping * factor(3)};
}

/// The same in the points' own axes; `frames` (9, 64).
template <class P, class N = typename P::N>
Vec3<N> in_point_axes(const typename P::Real* frames, const Vec3<N>& f) {
  const auto component = [&](int row) {
    const auto at = [&](int k) { return P::load(frames + (3 * row + k) * kTactileTile); };
    return mul_add(at(0), f.x, mul_add(at(1), f.y, at(2) * f.z));
  };
  return {component(0), component(1), component(2)};
}

/// The same in the sensor's own axes, when those are not orthonormal.
template <class N>
Vec3<N> in_skewed_axes(const double* axes, const Vec3<N>& force) {
  const N f[3] = {force.x, force.y, N(0.0) - force.z};
  N out[3];
  for (int i = 0; i < 3; ++i) {
    out[i] = N(0.0);
    for (int k = 0; k < 3; ++k) out[i] = mul_add(N(axes[3 * i + k]), f[k], out[i]);
  }
  return {out[0], out[1], out[2]};
}

}  // namespace tangere::kernels
