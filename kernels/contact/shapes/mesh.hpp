// SPDX-License-Identifier: Apache-2.0
// A closed mesh of scale s, by the spline φ of its distance at scale 1 (spline.hpp): with x = y/s,
//   d = s φ(x);  n = ∇φ(x);  H = ∇∇φ(x)/s;  ∂d/∂s = (d - n·y)/s;  ∂n/∂s = -H y/s
// |n| is 1 up to the error of the spline. It falls below 1 where the nearest place of the surface
// jumps: at edges from inside, and deep within. Every formula of contact takes n as the gradient
// that it is, so forces and their derivatives agree there as well.
//
// Beyond the grid, nothing touches. There d is that of the tangent plane at the nearest place of
// the grid, and H = 0.
#pragma once

#include "kernels/contact/shapes/shape.hpp"
#include "kernels/contact/shapes/spline.hpp"
#include "kernels/contact/shapes/spline_f32.hpp"

namespace tangere::kernels {

/// Clamps U to the grid and splits it.
template <class N>
GridPlace<N> place_in_grid(const DistanceGrid& g, const Vec3<N>& U, Vec3<N>& clamped) {
  GridPlace<N> at;
  const N zero(0.0), one(1.0), half(0.5);
  const N* u = &U.x;
  N* c = &clamped.x;
  for (int k = 0; k < 3; ++k) {
    const N most(double(g.cells[k]));
    c[k] = min(max(u[k], zero), most);  // NaN becomes zero
    at.whole[k] = min(round_nearest(c[k] - half), most - one);
    at.rest[k] = c[k] - at.whole[k];
  }
  const Vec3<N> away = U - clamped;
  const double longest = g.cells[0] + g.cells[1] + g.cells[2];
  at.whole[0] = select(dot(away, away) > N(longest * longest), N(kNowhere), at.whole[0]);
  return at;
}
template <class N>
Vec3<N> in_cells(const DistanceGrid& g, const Vec3<N>& y) {
  const N inverse(1 / g.cell);
  return {(y.x - N(g.origin[0])) * inverse, (y.y - N(g.origin[1])) * inverse,
          (y.z - N(g.origin[2])) * inverse};
}

/// Where a place is in a grid.
template <class N>
struct GridPoint {
  Vec3<N> clamped;
  GridPlace<N> at;
  N beyond;  ///< squared distance from the grid, in cells

  GridPoint(const DistanceGrid& g, const Vec3<N>& U) : at(place_in_grid(g, U, clamped)) {
    const Vec3<N> away = U - clamped;
    beyond = dot(away, away);
  }
};

/// Whether a place is nearer than m to the box of what touches. False where it is not finite.
template <class N>
auto near_box(const DistanceGrid& g, const Vec3<N>& y, const N& m) {
  const N* p = &y.x;
  N square(0.0);
  for (int k = 0; k < 3; ++k) {
    const N beyond = max(N(0.0), max(N(g.low[k]) - p[k], p[k] - N(g.high[k])));
    square = mul_add(beyond, beyond, square);
  }
  return square < m * m;
}

/// Whether a place may be nearer than m to a mesh of scale 1: not beyond m of the box of what
/// touches, and not where φ is more than it can fall on the way. Also true for slightly larger
/// distances. `Rough`: bounds of cells stand for φ.
template <bool Rough = false, class N>
auto near_mesh(const DistanceGrid& g, const Vec3<N>& y, const N& m) {
  const N zero(0.0);
  auto near = near_box(g, y, m);
  if (!any(near)) return near;
  GridPoint<N> point(g, in_cells(g, y));
  const N fall = N(g.slope) * m;
  // Nothing is read of lanes that are decided.
  const auto beyond = point.beyond > zero;
  const auto read_in = [&](const auto& lanes) {
    point.at.whole[0] = select(lanes, point.at.whole[0], N(kNowhere));
    return any(lanes);
  };
  if (!read_in(near & (point.beyond <= zero))) return near;
  near = near & (beyond | (floor_at(g, point.at) < fall));
  if (Rough || !read_in(near & (point.beyond <= zero))) return near;
  SplineValue<N, 0> phi;
  spline_at(g, point.at, phi);
  near = near & (beyond | (phi.value < fall));
  return near;
}

/// A bound of φ around a place, in cells. After a way s from a place where `value` is positive, as
/// long as φ > 0 on the way,
///   φ(U + s) = φ(U) + ∇φ·s + ∫(1 - τ) sᵀ∇∇φ(U + τ s) s dτ ≥ value + gradient·s - sag |s|²/2
/// The right side is concave along the way. So if it is positive at s, it is positive all the way,
/// there is no first place on it where φ = 0, and φ > 0 at s. Where `value` is not positive,
/// `gradient` and `sag` are zero.
template <class N>
struct FallBound {
  N value;  ///< [m], less than φ by far more than φ is rounded in single precision
  Vec3<N> gradient;
  N sag;
};

/// Whether a disc about U of radius m, in cells, may touch a mesh. `normal` is the unit normal of
/// its plane, or zero for a ball. Where a pad presses, it lies almost along the surface. There φ
/// falls far less than its slope allows. `bound`: at U, for ways up to m, where something may
/// touch. Discs larger than kSagBlock are tested by the floor of a cell; their bound is kNoBound.
template <class N>
auto disc_near_mesh(const DistanceGrid& g, const Vec3<N>& U, const N& m, const Vec3<N>& normal,
                    FallBound<N>& bound) {
  const N zero(0.0), one(1.0), most(double{kSagBlock});
  GridPoint<N> point(g, U);
  const N fall = N(g.slope * g.cell) * m;
  // From beyond the grid, the way to what touches leads through the rim as well.
  const auto outside = point.beyond > zero;
  auto near = select(outside, point.beyond + N(kRim * kRim), zero) < m * m;
  bound.value = one;
  bound.gradient = zero3<N>();
  bound.sag = zero;
  if (!any(near)) return near;
  near = near & (outside | (floor_at(g, point.at) < fall));
  bound.value = select(near, N(kNoBound), one);
  const auto small = near & (m <= most) & (point.beyond <= zero);
  if (!any(small)) return near;
  point.at.whole[0] = select(small, point.at.whole[0], N(kNowhere));  // nothing is read there
  SplineValue<N, 1> phi;
  spline_at(g, point.at, phi);
  constexpr double kRounding = 1e-4;  // cells
  bound.value = select(small, phi.value - N(kRounding * g.cell), bound.value);
  const auto bounded = small & (bound.value > zero);
  for (int k = 0; k < 3; ++k) (&bound.gradient.x)[k] = select(bounded, phi.gradient[k], zero);
  bound.sag = select(bounded, sag_at(g, point.at), zero);
  const N across = dot(normal, bound.gradient);
  const N square = max(dot(bound.gradient, bound.gradient) - across * across, zero);
  const N along = root_of(square, inverse_sqrt(square));
  near = near & (bound.value < min(fall, m * mul_add(N(0.5) * m, bound.sag, along)));
  return near;
}

template <class P>
struct MeshPad;

template <class N>
struct MeshDistance {
  static constexpr Bending kBending = Bending::general;
  static constexpr PrimitiveShape kShape = PrimitiveShape::mesh;
  static constexpr PointSumForm kSums = PointSumForm::points;
  template <class P>
  using Pad = MeshPad<P>;
  const DistanceGrid* grid;
  N scale, inverse;

  static MeshDistance of(const Vec3<N>& size, const DistanceGrid* grid) {
    return {grid, size.x, N(1.0) / size.x};
  }

  Distance<N> evaluate(const Vec3<N>& y) const {
    SplineValue<N, 1> phi;
    return value_at<1>(inverse * y, phi);
  }
  /// Returns H as well.
  Distance<N> evaluate(const Vec3<N>& y, Mat3<N>& H) const {
    SplineValue<N, 2> phi;
    const Vec3<N> x = inverse * y;
    const Distance<N> at = value_at<2>(x, phi);
    const N slope = select(outside(x), N(0.0), N(1 / (grid->cell * grid->cell)) * inverse);
    constexpr int kEntry[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) H.m[i][j] = slope * phi.second[kEntry[i][j]];
    return at;
  }
  /// The cotangent of the scale from those of the shape's place, ρ̄ = -d̄ n - H n̄, and of d, d̄.
  Vec3<N> size_share(const Vec3<N>& y, const N& d, const Vec3<N>& rho, const N& d_bar) const {
    return {inverse * mul_add(d_bar, d, dot(y, rho)), N(0.0), N(0.0)};
  }

  static Vec3<N> stretched(const Vec3<N>& to, const Vec3<double>& from, const Vec3<double>& y) {
    return to.x * Vec3<N>{N(y.x / from.x), N(y.y / from.x), N(y.z / from.x)};
  }
  static Vec3<N> stretch_share(const Vec3<double>& size, const Vec3<N>& y, const Vec3<N>& bar) {
    return {N(1 / size.x) * dot(y, bar), N(0.0), N(0.0)};
  }

 private:
  auto outside(const Vec3<N>& x) const {
    const Vec3<N> U = in_cells(*grid, x);
    const N* u = &U.x;
    const auto beyond = [&](int k) { return (u[k] < N(0.0)) | (u[k] > N(double(grid->cells[k]))); };
    return beyond(0) | beyond(1) | beyond(2);
  }
  /// Leaves the spline at x in `phi`, and returns d and n.
  template <int Order>
  Distance<N> value_at(const Vec3<N>& x, SplineValue<N, Order>& phi) const {
    const Vec3<N> U = in_cells(*grid, x);
    Vec3<N> clamped;
    const GridPlace<N> at = place_in_grid(*grid, U, clamped);
    spline_at(*grid, at, phi);
    const N slope(1 / grid->cell);
    const Distance<N> inside = {
        scale * phi.value,
        {slope * phi.gradient[0], slope * phi.gradient[1], slope * phi.gradient[2]}};
    const auto beyond = outside(x);
    if (!any(beyond)) return inside;
    const Vec3<N> way = phi.value * inside.n + N(grid->cell) * (U - clamped);
    const N square = select(beyond, dot(way, way), N(1.0)), one_over = inverse_sqrt(square);
    return {select(beyond, scale * root_of(square, one_over), inside.d),
            select(beyond, one_over * way, inside.n)};
  }
};

template <class N>
auto nearer_than(const MeshDistance<N>& shape, const Vec3<N>& y, const N& m) {
  return near_mesh(*shape.grid, shape.inverse * y, shape.inverse * m);
}

/// Whether a place may be nearer than m, from bounds of cells alone.
template <class N>
auto roughly_nearer_than(const MeshDistance<N>& shape, const Vec3<N>& y, const N& m) {
  return near_mesh<true>(*shape.grid, shape.inverse * y, shape.inverse * m);
}

/// Under a pad, a tile's centre is split into a cell, which is a whole number, and what is left.
/// Offsets are added to that. φ is then as accurate in single precision as it is small.
template <class P>
struct MeshPad {
  using N = typename P::N;
  using Offset = typename P::Offset;
  static constexpr bool kTurns = true;
  static constexpr int kRows = 14;  // whole cells, what is left, a bound of φ, u

  const DistanceGrid* grid;
  double scale;
  Mat3<N> Q;
  Vec3<N> whole, rest;
  N low, half_sag;  ///< after the offset s, φ ≥ low + fall·s - half_sag |s|² as long as φ > 0
  Vec3<N> fall;
  Vec3<N> u;

  MeshPad(const TouchShape& s, const Mat3<N>& pose) : grid(s.grid), scale(s.size[0]), Q(pose) {}

  template <class D>
  static D bracket(const TouchShape& s, const Touch<D>& at, const Vec3<D>& t, const D& reach,
                   D* row) {
    const D scale(1 / s.size[0]), cells(1 / (s.size[0] * s.grid->cell));
    const Vec3<D> U = in_cells(*s.grid, scale * transposed_times(at.Q, t - at.c));
    const D flat(P::kCurved ? 0.0 : 1.0);  // a flat pad lies in its plane z = 0
    const Vec3<D> normal = {flat * at.Q.m[2][0], flat * at.Q.m[2][1], flat * at.Q.m[2][2]};
    FallBound<D> bound;
    const auto near = disc_near_mesh(*s.grid, U, cells * reach, normal, bound);
    if (!any(near)) return D(1.0);
    const D* from = &U.x;
    for (int k = 0; k < 3; ++k) {
      row[k] = round_nearest(from[k]);
      row[3 + k] = from[k] - row[k];
    }
    const Vec3<D> fall = cells * (at.Q * bound.gradient);
    row[6] = bound.value, row[7] = D(0.5) * cells * cells * bound.sag;
    row[8] = fall.x, row[9] = fall.y, row[10] = fall.z;
    return select(near, D(-1.0), D(1.0));
  }

  void set(const N* row) {
    whole = {row[0], row[1], row[2]};
    rest = {row[3], row[4], row[5]};
    low = row[6], half_sag = row[7];
    fall = {row[8], row[9], row[10]};
  }

  auto distance(const Offset& s, N& d, Vec3<N>& n) const {
    const N zero(0.0), one(1.0), half(0.5), slope(1 / grid->cell), cells(1 / (grid->cell * scale));
    const N above = low + along(fall.x, fall.y, fall.z, s) - half_sag * square_of(s);
    if (!any(above < zero)) {
      d = one, n = zero3<N>();
      return d < zero;
    }
    const N e[3] = {along(Q.m[0][0], Q.m[1][0], Q.m[2][0], s),
                    along(Q.m[0][1], Q.m[1][1], Q.m[2][1], s),
                    along(Q.m[0][2], Q.m[1][2], Q.m[2][2], s)};
    GridPlace<N> at;
    N inside = one;
    for (int k = 0; k < 3; ++k) {
      const N most(double(grid->cells[k] - 1));
      const N from = mul_add(e[k], cells, (&rest.x)[k]);
      const N step = round_nearest(from - half), cell = (&whole.x)[k] + step;
      at.rest[k] = min(max(from - step, zero), one);  // finite for points that are far away
      at.whole[k] = min(max(cell, zero), most);
      inside = select((cell >= zero) & (cell < most + half), inside, zero);
    }
    SplineValue<N, 1> phi;
    spline_inside(*grid, at, above, phi);
    d = select(inside > half, N(scale) * phi.value, one);
    n = Q * (slope * Vec3<N>{phi.gradient[0], phi.gradient[1], phi.gradient[2]});
    return d < zero;
  }
};

}  // namespace tangere::kernels
