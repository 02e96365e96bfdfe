// SPDX-License-Identifier: Apache-2.0
// Length of a piece of a path between two points, with its gradient and Hessian by their places in
// the frame of the surface that it may go around.
//
//   straight  L = |x₁ - x₀|, ∂L = ±e, ∂²L = ±(1 - e eᵀ)/L
//   around a circle of radius r, by points at distance D from its centre, unit vectors x̂, n across
//   x̂ in the plane towards the other point, γ the angle between them, and σ = 1, or -1 for the
//   long way round:
//     L = Σ (t - r α) + r γ (or 2π - γ),  t = √(D² - r²),  α = arccos(r/D);  it wraps where
//         γ > Σ α, or by the long way
//     ∂L/∂x = (t x̂ - σ r n)/D,  ∂²L/∂x² = m mᵀ/t in the plane, m = (r x̂ + σ t n)/D
//   A sphere's plane is that of both points: across it, along b, the Hessian has also
//     (t₀ + σ r cot γ)/D₀², the same of 1, and -σ r/(sin γ D₀ D₁) between them
//   A cylinder's plane is across its axis: L' = √(L² + z²), z the way along the axis
// The tangent points drop out of all derivatives.
#pragma once

#include "kernels/numbers/rotation_vector.hpp"
#include "kernels/step/transmission_types.hpp"

namespace tangere::kernels {

/// Length of a piece [m], its gradient by the two points, and its Hessian.
template <class N>
struct PieceLength {
  N length;
  Vec3<N> slope[2];
  Mat3<N> second[2][2];
};

/// Returns the angle in [0, π] of a cosine and a sine that is not negative.
template <class N>
N angle_by(const N& cosine, const N& sine) {
  const auto acute = cosine > N(0.0);
  const N large = sqrt(N(0.5) * (N(1.0) + abs(cosine))), small = N(0.5) * sine / large;
  return rotation_vector<false>(
             Quat<N>{select(acute, large, small), select(acute, small, large), N(0.0), N(0.0)})
      .phi.x;
}

inline constexpr double kFullTurn = 6.283185307179586;  ///< 2 π

/// Keeps divisors away from 0.
template <class N>
N not_zero(const N& x) {
  constexpr double kLeast = 1e-12;
  return max(x, N(kLeast));
}
template <class N>
N length_of(const Vec3<N>& x) {
  return sqrt(max(dot(x, x), N(1e-24)));
}

template <class N>
PieceLength<N> straight_piece(const Vec3<N>& x0, const Vec3<N>& x1, const Mat3<N>& in_plane) {
  const Vec3<N> way = x1 - x0;
  const N length = length_of(way);
  const Vec3<N> e = (N(1.0) / length) * way;
  const Mat3<N> across = (N(1.0) / length) * (in_plane - outer(e, e));
  return {length, {-e, e}, {{across, -across}, {-across, across}}};
}

/// What a point has to do with the circle that a path goes around.
template <class N>
struct CirclePoint {
  N distance, tangent, alpha;  ///< D, t, α
  Vec3<N> out, along;          ///< x̂, n
};
template <class N>
CirclePoint<N> circle_point(const Vec3<N>& x, const N& radius) {
  CirclePoint<N> p;
  p.distance = length_of(x);
  const N square = (p.distance - radius) * (p.distance + radius);
  p.tangent = sqrt(max(square, N(1e-24)));
  p.out = (N(1.0) / p.distance) * x;
  p.alpha = angle_by(radius / p.distance, p.tangent / p.distance);
  return p;
}

/// Returns where a path touches the circle, over its radius; sign: 1, or -1 for the long way.
template <class N>
Vec3<N> touch_point(const CirclePoint<N>& p, const N& radius, const N& sign) {
  return (radius / p.distance) * p.out + (sign * p.tangent / p.distance) * p.along;
}

/// Returns whether a path that has a side takes the long way.
template <class N>
auto takes_long_way(const CirclePoint<N> (&p)[2], const Vec3<N>& x0, const Vec3<N>& x1,
                    const N& radius, const Vec3<N>& side, const N& excess) {
  const auto towards = [&](const N& sign) {
    const Vec3<N> middle = touch_point(p[0], radius, sign) + touch_point(p[1], radius, sign);
    return dot(middle, side) / length_of(middle);
  };
  const Vec3<N> way = x1 - x0;
  const N part = min(max(-dot(x0, way) / not_zero(dot(way, way)), N(0.0)), N(1.0));
  const N clear = -dot(x0 + part * way, side), around = towards(N(-1.0)) - towards(N(1.0));
  return select(excess > N(0.0), around, clear) > N(0.0);
}

/// The piece around a circle in the plane `in_plane` projects to; `round`: a sphere's plane is that
/// of the points.
template <class N>
PieceLength<N> circle_piece(const TransmissionPiece& piece, const Vec3<N>& x0, const Vec3<N>& x1,
                            const Mat3<N>& in_plane, const Vec3<N>& side) {
  const N r(piece.radius);
  CirclePoint<N> p[2] = {circle_point(x0, r), circle_point(x1, r)};
  const Vec3<N> normal = cross(p[0].out, p[1].out);
  const N cosine = dot(p[0].out, p[1].out), sine = length_of(normal);
  for (int i = 0; i < 2; ++i) p[i].along = (N(1.0) / sine) * (p[1 - i].out - cosine * p[i].out);
  const N gamma = angle_by(cosine, sine), excess = gamma - p[0].alpha - p[1].alpha;
  const auto inside = (p[0].distance < r) | (p[1].distance < r);
  N sign(1.0), turn = gamma, wraps = excess;
  if (piece.has_side) {
    const auto long_way = takes_long_way(p, x0, x1, r, side, excess);
    sign = select(long_way, N(-1.0), sign);
    turn = select(long_way, N(kFullTurn) - gamma, turn);
    wraps = select(long_way, N(1.0), wraps);
  }
  const auto straight = inside | (wraps <= N(0.0));
  const PieceLength<N> line = straight_piece(x0, x1, in_plane);
  PieceLength<N> out;
  out.length = r * (turn - p[0].alpha - p[1].alpha) + p[0].tangent + p[1].tangent;
  const bool ball = piece.kind == PieceKind::sphere;
  const Vec3<N> b = (N(1.0) / sine) * normal;
  for (int i = 0; i < 2; ++i) {
    const CirclePoint<N>& at = p[i];
    const N inverse = N(1.0) / at.distance;
    out.slope[i] = inverse * (at.tangent * at.out - (sign * r) * at.along);
    const Vec3<N> m = inverse * (r * at.out + (sign * at.tangent) * at.along);
    out.second[i][i] = outer((N(1.0) / at.tangent) * m, m);
    out.second[i][1 - i] = zero33<N>();
    if (!ball) continue;
    out.second[i][i] += outer(((at.tangent + sign * r * cosine / sine) * inverse * inverse) * b, b);
    out.second[i][1 - i] = outer((-(sign * r) / (sine * p[0].distance * p[1].distance)) * b, b);
  }
  out.length = select(straight, line.length, out.length);
  for (int i = 0; i < 2; ++i) {
    out.slope[i] = select(straight, line.slope[i], out.slope[i]);
    for (int j = 0; j < 2; ++j)
      for (int k = 0; k < 9; ++k) {
        N& to = out.second[i][j].m[k / 3][k % 3];
        to = select(straight, line.second[i][j].m[k / 3][k % 3], to);
      }
  }
  return out;
}

/// Lengthens a piece in the plane across an axis by the way along it.
template <class N>
PieceLength<N> helix(const PieceLength<N>& flat, const Vec3<N>& axis, const N& along) {
  PieceLength<N> out;
  out.length = sqrt(max(flat.length * flat.length + along * along, N(1e-24)));
  const N inverse = N(1.0) / out.length;
  const Vec3<N> ways[2] = {-axis, axis};
  for (int i = 0; i < 2; ++i)
    out.slope[i] = inverse * (flat.length * flat.slope[i] + along * ways[i]);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      out.second[i][j] =
          inverse * (outer(flat.slope[i], flat.slope[j]) + flat.length * flat.second[i][j] +
                     outer(ways[i], ways[j]) - outer(out.slope[i], out.slope[j]));
  return out;
}

/// Returns the length of a piece between two points relative to the centre of its surface, in any
/// axes, those of `axis` and `side`.
template <class N>
PieceLength<N> piece_length(const TransmissionPiece& piece, const Vec3<N>& x0, const Vec3<N>& x1,
                            const Vec3<N>& axis, const Vec3<N>& side) {
  const Mat3<N> one = diagonal(N(1.0));
  if (piece.kind == PieceKind::straight) return straight_piece(x0, x1, one);
  if (piece.kind == PieceKind::sphere) return circle_piece(piece, x0, x1, one, side);
  const auto flat = [&](const Vec3<N>& x) { return x - dot(axis, x) * axis; };
  return helix(circle_piece(piece, flat(x0), flat(x1), one - outer(axis, axis), side), axis,
               dot(axis, x1 - x0));
}

}  // namespace tangere::kernels
