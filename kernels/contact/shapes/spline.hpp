// SPDX-License-Identifier: Apache-2.0
// The distance to a mesh as one smooth function: a tricubic B-spline on a grid (docs/contact.md).
//
// With U = (y - origin)/cell, i the whole parts of U and t the rest,
//   φ(y) = Σ c[i + a, j + b, k + c] w_a(t_x) w_b(t_y) w_c(t_z),  a, b, c = 0 … 3
//   w = ((1 - t)³, 3t³ - 6t² + 4, …, t³)/6
// φ, ∇φ and ∇∇φ are continuous. Derivatives take w' and w'' in place of w, divided by the cell.
// Sums run over y first, then x, then z. The four rows along z of a place at one y are neighbours
// in memory, so one load fills a vector.
#pragma once

#include <type_traits>

#include "kernels/contact/shapes/distance_grid.hpp"
#include "kernels/numbers/lanes.hpp"
#include "kernels/numbers/linalg.hpp"
#include "kernels/numbers/one_lane.hpp"

namespace tangere::kernels {

/// The four weights as polynomials of t: factors of t³, t², t and 1.
inline constexpr double kSplineWeights[4][4] = {{-1.0 / 6, 0.5, -0.5, 1.0 / 6},
                                                {0.5, -1, 0, 2.0 / 3},
                                                {-0.5, 0.5, 0.5, 1.0 / 6},
                                                {1.0 / 6, 0, 0, 0}};
/// Returns a weight or its derivative of this order. f: factors of t³, t², t and 1, times the
/// factors that differentiating brings.
template <int Order, class N>
[[gnu::always_inline]] inline N weight_at(const N (&f)[4], const N& t) {
  N sum = f[0];
  for (int k = 1; k < 4 - Order; ++k) sum = mul_add(sum, t, f[k]);
  return sum;
}
template <class N, int Order>
[[gnu::always_inline]] inline N weight_at(int which, const N& t) {
  const double* f = kSplineWeights[which];
  if constexpr (Order == 0) {
    const N factors[4] = {N(f[0]), N(f[1]), N(f[2]), N(f[3])};
    return weight_at<0>(factors, t);
  } else if constexpr (Order == 1) {
    const N factors[4] = {N(3 * f[0]), N(2 * f[1]), N(f[2]), N(0.0)};
    return weight_at<1>(factors, t);
  } else {
    const N factors[4] = {N(6 * f[0]), N(2 * f[1]), N(0.0), N(0.0)};
    return weight_at<2>(factors, t);
  }
}

/// Weights of four coefficients along one axis, and their derivatives by t.
template <class N, int Order>
struct SplineWeights {
  N w[Order + 1][4];

  explicit SplineWeights(const N& t) {
    for (int a = 0; a < 4; ++a) {
      w[0][a] = weight_at<N, 0>(a, t);
      if constexpr (Order > 0) w[1][a] = weight_at<N, 1>(a, t);
      if constexpr (Order > 1) w[2][a] = weight_at<N, 2>(a, t);
    }
  }
};

/// Sums over y and x for derivatives by x and y of these orders: 00, 01, 10, then 02, 11, 20.
template <int Order>
inline constexpr int kSplineSums = Order == 0   ? 1
                                   : Order == 1 ? 3
                                                : 6;
inline constexpr int kSplineX[6] = {0, 0, 1, 0, 1, 2}, kSplineY[6] = {0, 1, 0, 2, 1, 0};

/// φ and its derivatives by U.
template <class N, int Order>
struct SplineValue {
  N value;
  N gradient[Order > 0 ? 3 : 1];
  N second[Order > 1 ? 6 : 1];  ///< xx xy xz yy yz zz
};

/// Sums over z. sums: (kSplineSums, 4).
template <int Order, class N>
[[gnu::always_inline]] inline void sum_over_z(const N (*sums)[4], const SplineWeights<N, Order>& z,
                                              SplineValue<N, Order>& out) {
  const auto sum = [&](int which, int order) {
    N total = z.w[order][0] * sums[which][0];
    for (int k = 1; k < 4; ++k) total = mul_add(z.w[order][k], sums[which][k], total);
    return total;
  };
  out.value = sum(0, 0);
  if constexpr (Order > 0) {
    out.gradient[0] = sum(2, 0);
    out.gradient[1] = sum(1, 0);
    out.gradient[2] = sum(0, 1);
  }
  if constexpr (Order > 1) {
    out.second[0] = sum(5, 0);
    out.second[1] = sum(4, 0);
    out.second[2] = sum(2, 1);
    out.second[3] = sum(3, 0);
    out.second[4] = sum(1, 1);
    out.second[5] = sum(0, 2);
  }
}

/// Where a point is in the grid: whole parts and rests of U, which is clamped to the grid. whole[0]
/// is kNowhere where a point is farther away than the grid is long. There φ is taken as zero.
template <class N>
struct GridPlace {
  N whole[3], rest[3];
};
inline constexpr double kNowhere = -1;

/// The number of a cell's first coefficient.
inline long first_coefficient(const DistanceGrid& g, double x, double y, double z) {
  return long(x) * kQuad + long(y) * g.plane + long(z) * g.row;
}

template <class N>
double plain_value(const N& x) {
  if constexpr (std::is_same_v<N, double>) {
    return x;
  } else {
    return plain_value(x.value);
  }
}

/// One number after the other: plain and dual numbers.
template <int Order, class N>
void spline_at(const DistanceGrid& g, const GridPlace<N>& at, SplineValue<N, Order>& out) {
  if (plain_value(at.whole[0]) < 0) {
    out = {};
    return;
  }
  const SplineWeights<N, Order> x(at.rest[0]), y(at.rest[1]), z(at.rest[2]);
  const float* c =
      g.coefficients + first_coefficient(g, plain_value(at.whole[0]), plain_value(at.whole[1]),
                                         plain_value(at.whole[2]));
  N sums[kSplineSums<Order>][4];
  for (int k = 0; k < 4; ++k) {
    N y_sums[Order + 1][4];
    for (int i = 0; i < 4; ++i)
      for (int o = 0; o <= Order; ++o) {
        const float* at_row = c + i * kQuad + k;
        y_sums[o][i] = y.w[o][0] * N(double(at_row[0]));
        for (int j = 1; j < 4; ++j)
          y_sums[o][i] = mul_add(y.w[o][j], N(double(at_row[j * g.plane])), y_sums[o][i]);
      }
    for (int s = 0; s < kSplineSums<Order>; ++s) {
      const N(&w)[4] = x.w[kSplineX[s]];
      const N(&r)[4] = y_sums[kSplineY[s]];
      sums[s][k] = mul_add(w[2], r[2], w[0] * r[0]) + mul_add(w[3], r[3], w[1] * r[1]);
    }
  }
  sum_over_z<Order>(sums, z, out);
}

/// The number of a place's cell in `floors`, or kNowhere.
template <class N>
N cell_number(const DistanceGrid& g, const GridPlace<N>& at) {
  const N cell = mul_add(at.whole[2], N(double(g.row / kQuad)),
                         mul_add(at.whole[1], N(double(g.plane / kQuad)), at.whole[0]));
  return select(at.whole[0] < N(0.0), N(kNowhere), cell);
}
/// No more than φ in the cell of this number.
inline double floor_in_cell(const DistanceGrid& g, double cell) {
  return cell < 0 ? 0.0 : double(g.floors[int(cell)]);
}
template <class N>
N floor_at(const DistanceGrid& g, const GridPlace<N>& at) {
  return N(floor_in_cell(g, plain_value(cell_number(g, at))));
}
template <class A>
OneLane<A> floor_at(const DistanceGrid& g, const GridPlace<OneLane<A>>& at) {
  return {floor_in_cell(g, cell_number(g, at).x)};
}
template <class A>
Lanes<A> floor_at(const DistanceGrid& g, const GridPlace<Lanes<A>>& at) {
  alignas(64) double cell[kGroup], out[kGroup];
  store_lanes(cell_number(g, at), cell);
  for (int l = 0; l < kGroup; ++l) out[l] = floor_in_cell(g, cell[l]);
  return load_lanes<A>(out);
}

/// How far φ bends downwards within kSagBlock cells of places in a cell.
inline double sag_around(const DistanceGrid& g, double x, double y, double z) {
  if (x < 0) return 0;
  const auto blocks = [&](int axis) { return (g.cells[axis] + kSagBlock - 1) / kSagBlock; };
  return double(g.sags[(int(x) / kSagBlock * blocks(1) + int(y) / kSagBlock) * blocks(2) +
                       int(z) / kSagBlock]);
}
template <class A>
Lanes<A> sag_at(const DistanceGrid& g, const GridPlace<Lanes<A>>& at) {
  alignas(64) double whole[3][kGroup], out[kGroup];
  for (int c = 0; c < 3; ++c) store_lanes(at.whole[c], whole[c]);
  for (int l = 0; l < kGroup; ++l) out[l] = sag_around(g, whole[0][l], whole[1][l], whole[2][l]);
  return load_lanes<A>(out);
}
inline double sag_at(const DistanceGrid& g, const GridPlace<double>& at) {
  return sag_around(g, at.whole[0], at.whole[1], at.whole[2]);
}

/// Loads two rows of four coefficients.
template <class A>
[[gnu::always_inline]] inline Lanes<A> load_two_rows(const float* from) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    Lanes<A> out;
    out.r[0] = _mm512_cvtps_pd(_mm256_loadu_ps(from));
    return out;
  }
#endif
  alignas(64) double both[kGroup];
  for (int k = 0; k < kGroup; ++k) both[k] = double(from[k]);
  return load_lanes<A>(both);
}
/// Returns a in the first four lanes and b in the others.
template <class A>
[[gnu::always_inline]] inline Lanes<A> two_halves(double a, double b) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    Lanes<A> out;
    out.r[0] = _mm512_mask_blend_pd(0xF0, _mm512_set1_pd(a), _mm512_set1_pd(b));
    return out;
  }
#endif
  alignas(64) const double both[kGroup] = {a, a, a, a, b, b, b, b};
  return load_lanes<A>(both);
}

/// Adds the two halves of a vector.
template <class A>
[[gnu::always_inline]] inline void add_halves(const Lanes<A>& x, double* out) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const __m512d all = x.r[0];
    _mm256_storeu_pd(out,
                     _mm256_add_pd(_mm512_castpd512_pd256(all), _mm512_extractf64x4_pd(all, 1)));
    return;
  }
#endif
  alignas(64) double halves[kGroup];
  store_lanes(x, halves);
  for (int k = 0; k < 4; ++k) out[k] = halves[k] + halves[4 + k];
}

/// Turns four numbers of each lane, `stride` apart, into four vectors.
template <class A>
[[gnu::always_inline]] inline void across_lanes(const double* own, int stride, Lanes<A>* out) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const auto two = [&](int a, int b) {
      return _mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_loadu_pd(own + a * stride)),
                                _mm256_loadu_pd(own + b * stride), 1);
    };
    const __m512d a = two(0, 2), b = two(1, 3), c = two(4, 6), d = two(5, 7);
    const __m512d ab0 = _mm512_unpacklo_pd(a, b), ab1 = _mm512_unpackhi_pd(a, b),
                  cd0 = _mm512_unpacklo_pd(c, d), cd1 = _mm512_unpackhi_pd(c, d);
    out[0].r[0] = _mm512_shuffle_f64x2(ab0, cd0, 0x88);
    out[1].r[0] = _mm512_shuffle_f64x2(ab1, cd1, 0x88);
    out[2].r[0] = _mm512_shuffle_f64x2(ab0, cd0, 0xDD);
    out[3].r[0] = _mm512_shuffle_f64x2(ab1, cd1, 0xDD);
    return;
  }
#endif
  alignas(64) double row[kGroup];
  for (int k = 0; k < 4; ++k) {
    for (int l = 0; l < kGroup; ++l) row[l] = own[l * stride + k];
    out[k] = load_lanes<A>(row);
  }
}

/// Sums over y and x at one place. Weight number w of an axis is at axis[stride * w].
template <int Order, class A>
[[gnu::always_inline]] inline void sum_rows(const float* c, const DistanceGrid& g, const double* x,
                                            const double* y, int stride, double (*out)[4]) {
  Lanes<A> y_sums[Order + 1][2];
  for (int j = 0; j < 4; ++j) {
    const float* from = c + j * g.plane;
    // Rows 0 and 1, then 2 and 3: each vector has two neighbours along x.
    const Lanes<A> rows[2] = {load_two_rows<A>(from), load_two_rows<A>(from + 2 * kQuad)};
    for (int o = 0; o <= Order; ++o) {
      const Lanes<A> w(y[stride * (4 * o + j)]);
      for (int half = 0; half < 2; ++half)
        y_sums[o][half] = j == 0 ? w * rows[half] : mul_add(w, rows[half], y_sums[o][half]);
    }
  }
  Lanes<A> x_weights[Order + 1][2];
  for (int o = 0; o <= Order; ++o)
    for (int half = 0; half < 2; ++half)
      x_weights[o][half] =
          two_halves<A>(x[stride * (4 * o + 2 * half)], x[stride * (4 * o + 2 * half + 1)]);
  for (int s = 0; s < kSplineSums<Order>; ++s) {
    const Lanes<A>*w = x_weights[kSplineX[s]], *r = y_sums[kSplineY[s]];
    add_halves(mul_add(w[1], r[1], w[0] * r[0]), out[s]);
  }
}

/// One lane on its own.
template <int Order, class A>
void spline_at(const DistanceGrid& g, const GridPlace<OneLane<A>>& at,
               SplineValue<OneLane<A>, Order>& out) {
  using N = OneLane<A>;
  if (at.whole[0].x < 0) {
    out = {};
    return;
  }
  const SplineWeights<N, Order> x(at.rest[0]), y(at.rest[1]), z(at.rest[2]);
  static_assert(sizeof(N) == sizeof(double));
  N sums[kSplineSums<Order>][4];
  sum_rows<Order, A>(
      g.coefficients + first_coefficient(g, at.whole[0].x, at.whole[1].x, at.whole[2].x), g,
      &x.w[0][0].x, &y.w[0][0].x, 1, reinterpret_cast<double(*)[4]>(sums));
  sum_over_z<Order>(sums, z, out);
}

/// Lane after lane up to the sums over z.
template <int Order, class A>
void spline_at(const DistanceGrid& g, const GridPlace<Lanes<A>>& at,
               SplineValue<Lanes<A>, Order>& out) {
  using N = Lanes<A>;
  constexpr int kWeights = 4 * (Order + 1), kSums = 4 * kSplineSums<Order>;
  alignas(64) double whole[3][kGroup], x[kWeights][kGroup], y[kWeights][kGroup];
  for (int c = 0; c < 3; ++c) store_lanes(at.whole[c], whole[c]);
  {
    const SplineWeights<N, Order> x_weights(at.rest[0]), y_weights(at.rest[1]);
    for (int w = 0; w < kWeights; ++w) {
      store_lanes((&x_weights.w[0][0])[w], x[w]);
      store_lanes((&y_weights.w[0][0])[w], y[w]);
    }
  }
  double own[kGroup][kSplineSums<Order>][4];
  for (int l = 0; l < kGroup; ++l) {
    if (whole[0][l] < 0) {
      for (int s = 0; s < kSums; ++s) (&own[l][0][0])[s] = 0;
    } else {
      sum_rows<Order, A>(
          g.coefficients + first_coefficient(g, whole[0][l], whole[1][l], whole[2][l]), g, &x[0][l],
          &y[0][l], kGroup, own[l]);
    }
  }
  N sums[kSplineSums<Order>][4];
  for (int s = 0; s < kSplineSums<Order>; ++s) across_lanes<A>(own[0][s], kSums, sums[s]);
  sum_over_z<Order>(sums, SplineWeights<N, Order>(at.rest[2]), out);
}

/// Stands for a bound of φ that nothing is known about [m].
inline constexpr double kNoBound = -1;

/// φ and ∇φ where φ < 0; elsewhere some φ ≥ 0. Where `above` is not negative, or the cell does not
/// reach inside, nothing else is read.
template <class A>
void spline_inside(const DistanceGrid& g, const GridPlace<Lanes<A>>& at, const Lanes<A>& above,
                   SplineValue<Lanes<A>, 1>& out) {
  const Lanes<A> zero(0.0);
  GridPlace<Lanes<A>> wanted = at;
  wanted.whole[0] =
      select((above < zero) & (floor_at(g, at) < zero), at.whole[0], Lanes<A>(kNowhere));
  if (any(wanted.whole[0] >= zero)) return spline_at(g, wanted, out);
  out = {Lanes<A>(1.0), {zero, zero, zero}, {}};
}

/// Two vectors side by side (kernels/tactile/vector_pair.hpp).
template <int Order, template <class> class Pair, class M>
requires requires { &Pair<M>::a; }
void spline_inside(const DistanceGrid& g, const GridPlace<Pair<M>>& at, const Pair<M>& above,
                   SplineValue<Pair<M>, Order>& out) {
  const auto part = [&](M Pair<M>::*of) {
    GridPlace<M> one;
    for (int c = 0; c < 3; ++c) one.whole[c] = at.whole[c].*of, one.rest[c] = at.rest[c].*of;
    SplineValue<M, Order> value;
    spline_inside(g, one, above.*of, value);
    return value;
  };
  const SplineValue<M, Order> a = part(&Pair<M>::a), b = part(&Pair<M>::b);
  out.value = {a.value, b.value};
  for (int c = 0; c < 3; ++c) out.gradient[c] = {a.gradient[c], b.gradient[c]};
}

}  // namespace tangere::kernels
