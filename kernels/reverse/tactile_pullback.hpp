// SPDX-License-Identifier: Apache-2.0
// Pullback of a tactile field: from cotangents of its touched tiles to those of every shape's
// displacement and twist, eight points at a time, in double. The field is recomputed, not stored.
#pragma once

#include "kernels/reverse/point_pullback.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// Inputs of the sums of one shape over a pad.
template <class N>
struct PadMotion {
  Mat3<N> Q;
  Vec3<N> c, omega, v;
  LawParameters<N> law;
};

template <class N>
PadMotion<N> pad_motion(const Touch<double>& t, ContactLaw law) {
  return {broadcast<N>(t.Q),
          broadcast<N>(t.c),
          broadcast<N>(t.omega),
          broadcast<N>(t.v),
          {transformed(t.law, [](double a) { return N(a); }), law, 0.0}};
}

/// Loads eight numbers from any address: callers' arrays need not be aligned.
template <class A>
Lanes<A> load_anywhere(const double* p) {
  Lanes<A> x;
  __builtin_memcpy(&x, p, sizeof x);
  return x;
}

/// Returns the cotangent of the force, pad axes, from that of the field at the points of a tile
/// from k on.
template <class A>
Vec3<Lanes<A>> force_cotangent(const PadTiles& pad, int tile, int k, const double* field) {
  using N = Lanes<A>;
  const N t[3] = {load_anywhere<A>(field + k), load_anywhere<A>(field + kTactileTile + k),
                  load_anywhere<A>(field + 2 * kTactileTile + k)};
  if (pad.curved()) {  // rows act on (f·x, f·y, -f·z)
    const double* frames = pad.frames + 9 * kTactileTile * tile + k;
    N f[3];
    for (int c = 0; c < 3; ++c) {
      f[c] = load_lanes<A>(frames + c * kTactileTile) * t[0];
      f[c] = mul_add(load_lanes<A>(frames + (3 + c) * kTactileTile), t[1], f[c]);
      f[c] = mul_add(load_lanes<A>(frames + (6 + c) * kTactileTile), t[2], f[c]);
    }
    return {f[0], f[1], -f[2]};
  }
  if (!pad.skewed) return {t[0], t[1], -t[2]};
  N f[3];
  for (int c = 0; c < 3; ++c)
    f[c] =
        mul_add(N(pad.axes[c]), t[0], mul_add(N(pad.axes[3 + c]), t[1], N(pad.axes[6 + c]) * t[2]));
  return {f[0], f[1], f[2]};
}

/// Returns the points of a tile from k on, pad axes.
template <class A>
Vec3<Lanes<A>> tile_points(const PadTiles& pad, int tile, int k) {
  using N = Lanes<A>;
  const int width = pad.curved() ? 3 : 2;
  const double* s = pad.offsets + width * kTactileTile * pad.kind[tile] + k;
  const Vec3<N> centre = {N(pad.x[tile]), N(pad.y[tile]), N(pad.z[tile])};
  return {centre.x + load_lanes<A>(s), centre.y + load_lanes<A>(s + kTactileTile),
          pad.curved() ? centre.z + load_lanes<A>(s + 2 * kTactileTile) : centre.z};
}

template <class N>
void store_anywhere(const N& x, double* p) {
  __builtin_memcpy(p, &x, sizeof x);
}

/// Returns the factors of coefficient c of eight points. The pad must have factors.
template <class A>
Lanes<A> point_factors(const PadTiles& pad, int tile, int k, std::size_t c) {
  const int row = kPointCoefficients * tile + static_cast<int>(factor_index(c));
  return load_lanes<A>(pad.factors + row * kTactileTile + k);
}

/// Returns the coefficients of eight points: the sensor's, or the sensor's times each point's
/// factors.
template <class A>
LawParameters<Lanes<A>> law_of_points(const PadTiles& pad, int tile, int k,
                                      const LawParameters<Lanes<A>>& sensor_law) {
  LawParameters<Lanes<A>> law = sensor_law;
  if (pad.factors == nullptr) return law;
  for (std::size_t c = 0; c < kPointCoefficients; ++c)
    law[c] = law[c] * point_factors<A>(pad, tile, k, c);
  return law;
}

/// Returns false where no point of a tile can touch the shape.
template <class Shape, class N>
bool reaches(const Shape& shape, const PadMotion<N>& m, const PadTiles& pad, int tile) {
  const Vec3<N> centre = {N(pad.x[tile]), N(pad.y[tile]), N(pad.z[tile])};
  const Vec3<N> y = transposed_times(m.Q, centre - m.c);
  if constexpr (Shape::kShape == PrimitiveShape::mesh)
    return any(nearer_than(shape, y, N(pad.radius[tile])));
  return any(distance_at(shape, y).d < N(pad.radius[tile]));
}

/// Adds to the own numbers of eight points. `to`: (kPointNumbers, 64), at the first of the points.
template <class A>
void add_to_points(const PlaceCotangent<Lanes<A>>& place, const Coefficients<Lanes<A>>& law,
                   double* to) {
  const Vec3<Lanes<A>> xi = place.x - place.rho;
  const Lanes<A> numbers[kPointNumbers] = {xi.x, xi.y, xi.z, law[0], law[1], law[2], law[3]};
  for (int i = 0; i < kPointNumbers; ++i)
    store_lanes(load_lanes<A>(to + i * kTactileTile) + numbers[i], to + i * kTactileTile);
}

/// Adds eight points. `own`: (kPointNumbers, 64) of the tile, or nullptr.
template <class A, bool OfLaw, class Shape>
void pull_back_points(const PadTiles& pad, int tile, int k, const double* field, const Shape& shape,
                      const PadMotion<Lanes<A>>& m, double* own, TouchCotangent<Lanes<A>>& sums) {
  using N = Lanes<A>;
  const LawParameters<N> law = law_of_points<A>(pad, tile, k, m.law);
  const Vec3<N> xi = tile_points<A>(pad, tile, k);
  const PointContact<N> p = point_contact(shape, law, m.Q, m.c, m.omega, m.v, xi);
  const auto touching = p.d < N(0.0);
  if (!any(touching)) return;
  const Vec3<N> f_bar = select(touching, N(1.0), N(0.0)) * force_cotangent<A>(pad, tile, k, field);
  const PlaceCotangent<N> place = pull_back_motion<Shape>(law, p, m.omega, f_bar, sums);
  if constexpr (!OfLaw) return;
  sums.size += pull_back_size(shape, p, m.Q, m.c, xi, place.rho, place.d);
  Coefficients<N> law_bar = {N(0.0), N(0.0), N(0.0), N(0.0)};
  pull_back_law(law, p, f_bar, law_bar);
  if (own != nullptr) add_to_points<A>(place, law_bar, own + k);
  for (std::size_t c = 0; c < kPointCoefficients; ++c) {
    const N factor = pad.factors == nullptr ? N(1.0) : point_factors<A>(pad, tile, k, c);
    sums.law[c] = mul_add(factor, law_bar[c], sums.law[c]);
  }
}

/// Sums over the lanes, in order.
template <class N>
double lane_sum(const N& a) {
  alignas(64) double x[kGroup];
  store_lanes(a, x);
  double sum = x[0];
  for (int l = 1; l < kGroup; ++l) sum += x[l];
  return sum;
}

template <class A, bool OfLaw>
void pull_back_touch(const TactilePullback& a, int touch, TouchCotangent<double>& out) {
  using N = Lanes<A>;
  const PadMotion<N> m = pad_motion<N>(a.touches[touch], a.law);
  const TouchShape& s = a.shapes[touch];
  TouchCotangent<N> sums = {zero6<N>(), zero6<N>(), {N(0.0), N(0.0), N(0.0), N(0.0)}, zero3<N>()};
  with_distance<N>(
      s.shape, Vec3<double>{s.size[0], s.size[1], s.size[2]},
      [&]<class Shape>(const Shape& shape) {
        for (int i = 0; i < a.count; ++i) {
          const int tile = a.tiles[i];
          if (!reaches(shape, m, *a.pad, tile)) continue;
          const double* field = a.cotangents + 3 * kTactileTile * i;
          double* own =
              a.points_bar == nullptr ? nullptr : a.points_bar + kPointNumbers * kTactileTile * i;
          for (int k = 0; k < kTactileTile; k += kGroup)
            pull_back_points<A, OfLaw>(*a.pad, tile, k, field, shape, m, own, sums);
        }
      },
      s.grid);
  const N* from = &sums.displacement.a.x;
  double* to = &out.displacement.a.x;
  constexpr int kSums = sizeof(TouchCotangent<double>) / sizeof(double);
  for (int i = 0; i < kSums; ++i) to[i] = lane_sum(from[i]);
}

template <class A>
void pull_back_field(const TactilePullback& a) {
  for (int k = 0; k < a.n_touches; ++k)
    a.with_law || a.points_bar != nullptr ? pull_back_touch<A, true>(a, k, a.out[k])
                                          : pull_back_touch<A, false>(a, k, a.out[k]);
}

}  // namespace tangere::kernels
