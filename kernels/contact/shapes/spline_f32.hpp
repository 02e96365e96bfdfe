// SPDX-License-Identifier: Apache-2.0
// The spline of a mesh (spline.hpp) at sixteen places in single precision. A vector of lanes is
// also taken as four blocks of four floats: block a has the coefficients of row a along x, four
// neighbours along z.
#pragma once

#include "kernels/contact/shapes/spline.hpp"
#include "kernels/numbers/lanes_f32.hpp"

namespace tangere::kernels {

/// Returns four coefficients from each of four rows.
template <class A>
[[gnu::always_inline]] inline LanesF<A> load_four_rows(const float* from, int plane) {
  [[maybe_unused]] LanesF<A> out;
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    __m512 all = _mm512_castps128_ps512(_mm_loadu_ps(from));
    all = _mm512_insertf32x4(all, _mm_loadu_ps(from + plane), 1);
    all = _mm512_insertf32x4(all, _mm_loadu_ps(from + 2 * plane), 2);
    out.r[0] = _mm512_insertf32x4(all, _mm_loadu_ps(from + 3 * plane), 3);
    return out;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    out.r[0] = _mm256_loadu2_m128(from + plane, from);
    out.r[1] = _mm256_loadu2_m128(from + 3 * plane, from + 2 * plane);
    return out;
  }
#endif
  alignas(64) float all[kLanesF];
  for (int a = 0; a < 4; ++a) __builtin_memcpy(all + 4 * a, from + a * plane, 4 * sizeof(float));
  return load_lanes_f<A>(all);
}

/// Returns blocks that have w[0], w[1], w[2] and w[3] four times.
template <class A>
[[gnu::always_inline]] inline LanesF<A> block_weights(const float* w) {
  [[maybe_unused]] LanesF<A> out;
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const __m512i which = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
    out.r[0] = _mm512_permutevar_ps(_mm512_broadcast_f32x4(_mm_load_ps(w)), which);
    return out;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    const __m256 all = _mm256_broadcast_ps(reinterpret_cast<const __m128*>(w));
    out.r[0] = _mm256_permutevar_ps(all, _mm256_set_epi32(1, 1, 1, 1, 0, 0, 0, 0));
    out.r[1] = _mm256_permutevar_ps(all, _mm256_set_epi32(3, 3, 3, 3, 2, 2, 2, 2));
    return out;
  }
#endif
  alignas(64) float all[kLanesF];
  for (int l = 0; l < kLanesF; ++l) all[l] = w[l / 4];
  return load_lanes_f<A>(all);
}

/// Adds up the blocks of each of four vectors, (0 + 2) + (1 + 3). Sum p becomes block p.
template <class A>
[[gnu::always_inline]] inline LanesF<A> block_sums(const LanesF<A> (&x)[4]) {
  [[maybe_unused]] LanesF<A> out;
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const auto pair = [](__m512 a, __m512 b) {  // a's 0 + 2, 1 + 3, then b's
      return _mm512_add_ps(_mm512_shuffle_f32x4(a, b, 0x44), _mm512_shuffle_f32x4(a, b, 0xEE));
    };
    const __m512 ab = pair(x[0].r[0], x[1].r[0]), cd = pair(x[2].r[0], x[3].r[0]);
    out.r[0] =
        _mm512_add_ps(_mm512_shuffle_f32x4(ab, cd, 0x88), _mm512_shuffle_f32x4(ab, cd, 0xDD));
    return out;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    for (int k = 0; k < 2; ++k) {
      const __m256 a = _mm256_add_ps(x[2 * k].r[0], x[2 * k].r[1]),
                   b = _mm256_add_ps(x[2 * k + 1].r[0], x[2 * k + 1].r[1]);
      out.r[k] =
          _mm256_add_ps(_mm256_permute2f128_ps(a, b, 0x20), _mm256_permute2f128_ps(a, b, 0x31));
    }
    return out;
  }
#endif
  alignas(64) float in[kLanesF], all[kLanesF];
  for (int p = 0; p < 4; ++p) {
    store_lanes_f(x[p], in);
    for (int k = 0; k < 4; ++k) all[4 * p + k] = (in[k] + in[8 + k]) + (in[4 + k] + in[12 + k]);
  }
  return load_lanes_f<A>(all);
}

/// Transposes block by block: number k of block q of vector j becomes number j of block q of vector
/// k.
template <class A>
[[gnu::always_inline]] inline void transpose_blocks(LanesF<A> (&x)[4]) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const __m512 a = x[0].r[0], b = x[1].r[0], c = x[2].r[0], d = x[3].r[0];
    const __m512d ab0 = _mm512_castps_pd(_mm512_unpacklo_ps(a, b)),
                  ab1 = _mm512_castps_pd(_mm512_unpackhi_ps(a, b)),
                  cd0 = _mm512_castps_pd(_mm512_unpacklo_ps(c, d)),
                  cd1 = _mm512_castps_pd(_mm512_unpackhi_ps(c, d));
    x[0].r[0] = _mm512_castpd_ps(_mm512_unpacklo_pd(ab0, cd0));
    x[1].r[0] = _mm512_castpd_ps(_mm512_unpackhi_pd(ab0, cd0));
    x[2].r[0] = _mm512_castpd_ps(_mm512_unpacklo_pd(ab1, cd1));
    x[3].r[0] = _mm512_castpd_ps(_mm512_unpackhi_pd(ab1, cd1));
    return;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    for (int k = 0; k < 2; ++k) {
      const __m256 a = x[0].r[k], b = x[1].r[k], c = x[2].r[k], d = x[3].r[k];
      const __m256d ab0 = _mm256_castps_pd(_mm256_unpacklo_ps(a, b)),
                    ab1 = _mm256_castps_pd(_mm256_unpackhi_ps(a, b)),
                    cd0 = _mm256_castps_pd(_mm256_unpacklo_ps(c, d)),
                    cd1 = _mm256_castps_pd(_mm256_unpackhi_ps(c, d));
      x[0].r[k] = _mm256_castpd_ps(_mm256_unpacklo_pd(ab0, cd0));
      x[1].r[k] = _mm256_castpd_ps(_mm256_unpackhi_pd(ab0, cd0));
      x[2].r[k] = _mm256_castpd_ps(_mm256_unpacklo_pd(ab1, cd1));
      x[3].r[k] = _mm256_castpd_ps(_mm256_unpackhi_pd(ab1, cd1));
    }
    return;
  }
#endif
  alignas(64) float in[4][kLanesF], out[4][kLanesF];
  for (int j = 0; j < 4; ++j) store_lanes_f(x[j], in[j]);
  for (int k = 0; k < 4; ++k)
    for (int l = 0; l < kLanesF; ++l) out[k][l] = in[l % 4][l - l % 4 + k];
  for (int k = 0; k < 4; ++k) x[k] = load_lanes_f<A>(out[k]);
}

/// Sums over y and x at sixteen places, one after the other. first: their first coefficients.
template <class A>
void sum_places_f(const DistanceGrid& g, const float* const* first,
                  const SplineWeights<LanesF<A>, 1>& x, const SplineWeights<LanesF<A>, 1>& y,
                  LanesF<A> (*out)[4]) {
  using N = LanesF<A>;
  alignas(64) float of_x[2][4][kLanesF];  // the four weights of place 4 q + j at [j][4 q]
  alignas(64) float of_y[2][4][kLanesF];
  for (int o = 0; o < 2; ++o) {
    N rows[4] = {x.w[o][0], x.w[o][1], x.w[o][2], x.w[o][3]};
    transpose_blocks(rows);
    for (int j = 0; j < 4; ++j) store_lanes_f(rows[j], of_x[o][j]);
    for (int b = 0; b < 4; ++b) store_lanes_f(y.w[o][b], of_y[o][b]);
  }
#pragma GCC unroll 1
  for (int j = 0; j < 4; ++j) {
    N part[3][4];
#pragma GCC unroll 4
    for (int q = 0; q < 4; ++q) {
      const int place = 4 * q + j;
      const float* const c = first[place];
      N sum[2];
      for (int b = 0; b < 4; ++b) {
        const N rows = load_four_rows<A>(c + b * g.row, g.plane);
        for (int o = 0; o < 2; ++o) {
          const N w(double{of_y[o][b][place]});
          sum[o] = b == 0 ? w * rows : mul_add(w, rows, sum[o]);
        }
      }
      const N weight[2] = {block_weights<A>(of_x[0][j] + 4 * q),
                           block_weights<A>(of_x[1][j] + 4 * q)};
      for (int s = 0; s < 3; ++s) part[s][q] = weight[kSplineX[s]] * sum[kSplineY[s]];
    }
    for (int s = 0; s < 3; ++s) out[s][j] = block_sums(part[s]);
  }
  for (int s = 0; s < 3; ++s) transpose_blocks(out[s]);
}

/// Sums over y and x with the coefficients of one cell for all lanes: the same sums.
template <class A>
[[gnu::always_inline]] inline void sum_cell_f(const float* c, const DistanceGrid& g,
                                              const SplineWeights<LanesF<A>, 1>& x,
                                              const SplineWeights<LanesF<A>, 1>& y,
                                              LanesF<A> (*out)[4]) {
  using N = LanesF<A>;
  for (int k = 0; k < 4; ++k) {
    N of_y[2][4];
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const N at(double{c[i * g.plane + j * g.row + k]});
        for (int o = 0; o < 2; ++o)
          of_y[o][i] = j == 0 ? y.w[o][0] * at : mul_add(y.w[o][j], at, of_y[o][i]);
      }
    for (int s = 0; s < 3; ++s) {
      const N(&w)[4] = x.w[kSplineX[s]];
      const N(&r)[4] = of_y[kSplineY[s]];
      out[s][k] = (w[0] * r[0] + w[2] * r[2]) + (w[1] * r[1] + w[3] * r[3]);
    }
  }
}

/// Sixteen points in single precision. On a dense pad all of them are often in one cell. Then its
/// coefficients are read once, for the same sums.
template <class A>
void spline_at(const DistanceGrid& g, const GridPlace<LanesF<A>>& at,
               SplineValue<LanesF<A>, 1>& out) {
  using N = LanesF<A>;
  alignas(64) float whole[3][kLanesF];
  const float* first[kLanesF];
  for (int c = 0; c < 3; ++c) store_lanes_f(at.whole[c], whole[c]);
  for (int l = 0; l < kLanesF; ++l)
    first[l] =
        g.coefficients + (int(whole[0][l]) * g.plane + int(whole[1][l]) * g.row + int(whole[2][l]));
  bool several = false;
  for (int c = 0; c < 3; ++c) {
    const N one(double{whole[c][0]});
    several = several || any(at.whole[c] < one) || any(at.whole[c] > one);
  }
  const SplineWeights<N, 1> x(at.rest[0]), y(at.rest[1]);
  N sums[3][4];
  if (several) {
    sum_places_f<A>(g, first, x, y, sums);
  } else {
    sum_cell_f<A>(first[0], g, x, y, sums);
  }
  sum_over_z<1>(sums, SplineWeights<N, 1>(at.rest[2]), out);
}

}  // namespace tangere::kernels
