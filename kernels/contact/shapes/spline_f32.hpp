// SPDX-License-Identifier: Apache-2.0
// The spline of a mesh (spline.hpp) at sixteen places in single precision. A vector of lanes is
// also taken as four blocks of four floats: block a has the coefficients of row a along x, four
// neighbours along z.
#pragma once

#include "kernels/contact/shapes/spline.hpp"
#include "kernels/numbers/lanes_f32.hpp"

namespace tangere::kernels {

/// Returns four coefficients from each of four rows, which are neighbours in memory.
template <class A>
[[gnu::always_inline]] inline LanesF<A> load_four_rows(const float* from) {
  [[maybe_unused]] LanesF<A> out;
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    __m512 all = _mm512_loadu_ps(from);
    asm("" : "+v"(all));  // it has two uses, and GCC would load it twice
    out.r[0] = all;
    return out;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    out.r[0] = _mm256_loadu_ps(from);
    out.r[1] = _mm256_loadu_ps(from + 8);
    return out;
  }
#endif
  alignas(64) float all[kLanesF];
  __builtin_memcpy(all, from, sizeof all);
  return load_lanes<A>(all);
}

/// Returns number j of each block four times.
template <class A>
[[gnu::always_inline]] inline LanesF<A> spread_in_blocks(const LanesF<A>& x, int j) {
  [[maybe_unused]] LanesF<A> out;
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    out.r[0] = _mm512_permutevar_ps(x.r[0], _mm512_set1_epi32(j));
    return out;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    for (int k = 0; k < 2; ++k) out.r[k] = _mm256_permutevar_ps(x.r[k], _mm256_set1_epi32(j));
    return out;
  }
#endif
  alignas(64) float in[kLanesF], all[kLanesF];
  store_lanes(x, in);
  for (int l = 0; l < kLanesF; ++l) all[l] = in[l - l % 4 + j];
  return load_lanes<A>(all);
}

/// Exchanges whole blocks: block q of vector p becomes block p of vector q.
template <class A>
[[gnu::always_inline]] inline void exchange_blocks(LanesF<A> (&x)[4]) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const __m512 a = x[0].r[0], b = x[1].r[0], c = x[2].r[0], d = x[3].r[0];
    const __m512 ab0 = _mm512_shuffle_f32x4(a, b, 0x44), ab1 = _mm512_shuffle_f32x4(a, b, 0xEE),
                 cd0 = _mm512_shuffle_f32x4(c, d, 0x44), cd1 = _mm512_shuffle_f32x4(c, d, 0xEE);
    x[0].r[0] = _mm512_shuffle_f32x4(ab0, cd0, 0x88);
    x[1].r[0] = _mm512_shuffle_f32x4(ab0, cd0, 0xDD);
    x[2].r[0] = _mm512_shuffle_f32x4(ab1, cd1, 0x88);
    x[3].r[0] = _mm512_shuffle_f32x4(ab1, cd1, 0xDD);
    return;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    const LanesF<A> from[4] = {x[0], x[1], x[2], x[3]};
    for (int k = 0; k < 2; ++k)
      for (int half = 0; half < 2; ++half) {
        const __m256 a = from[2 * half].r[k], b = from[2 * half + 1].r[k];
        x[2 * k].r[half] = _mm256_permute2f128_ps(a, b, 0x20);
        x[2 * k + 1].r[half] = _mm256_permute2f128_ps(a, b, 0x31);
      }
    return;
  }
#endif
  alignas(64) float in[4][kLanesF], out[4][kLanesF];
  for (int p = 0; p < 4; ++p) store_lanes(x[p], in[p]);
  for (int p = 0; p < 4; ++p)
    for (int l = 0; l < kLanesF; ++l) out[l / 4][4 * p + l % 4] = in[p][l];
  for (int p = 0; p < 4; ++p) x[p] = load_lanes<A>(out[p]);
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
  for (int j = 0; j < 4; ++j) store_lanes(x[j], in[j]);
  for (int k = 0; k < 4; ++k)
    for (int l = 0; l < kLanesF; ++l) out[k][l] = in[l % 4][l - l % 4 + k];
  for (int k = 0; k < 4; ++k) x[k] = load_lanes<A>(out[k]);
}

/// Whether φ may be negative in one of the cells.
template <class A>
[[gnu::always_inline]] inline bool any_inside(const float* floors, const int (&cell)[kLanesF]) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    const __m512 x = _mm512_i32gather_ps(_mm512_load_si512(cell), floors, 4);
    return _mm512_cmp_ps_mask(x, _mm512_setzero_ps(), _CMP_LT_OQ) != 0;
  }
#endif
  bool inside = false;
  for (const int c : cell) inside |= floors[c] < 0;
  return inside;
}

/// Returns the sum over x of one derivative, from sums over y.
template <class N>
[[gnu::always_inline]] inline N sum_over_x(const N (&w)[4], const N (&r)[4]) {
  N sum = w[0] * r[0];
  for (int i = 1; i < 4; ++i) sum = mul_add(w[i], r[i], sum);
  return sum;
}

/// Sums over y and x at sixteen places: over y one after the other, over x four at once, which are
/// the blocks of a vector.
template <class A>
void sum_places_f(const DistanceGrid& g, const int (&cell)[kLanesF],
                  const SplineWeights<LanesF<A>, 1>& x, const SplineWeights<LanesF<A>, 1>& y,
                  LanesF<A> (*out)[4]) {
  using N = LanesF<A>;
  alignas(64) float y_weights[2][4][kLanesF];
  for (int o = 0; o < 2; ++o)
    for (int b = 0; b < 4; ++b) store_lanes(y.w[o][b], y_weights[o][b]);
#pragma GCC unroll 1
  for (int j = 0; j < 4; ++j) {
    N sum[2][4];
#pragma GCC unroll 4
    for (int q = 0; q < 4; ++q) {
      const int place = 4 * q + j;
      const float* const c = g.coefficients + std::ptrdiff_t(kQuad) * cell[place];
      for (int b = 0; b < 4; ++b) {
        const N rows = load_four_rows<A>(c + b * g.plane);
        for (int o = 0; o < 2; ++o) {
          const N w(double{y_weights[o][b][place]});
          sum[o][q] = b == 0 ? w * rows : mul_add(w, rows, sum[o][q]);
        }
      }
    }
    N weight[2][4];
    for (int o = 0; o < 2; ++o) {
      for (int i = 0; i < 4; ++i) weight[o][i] = spread_in_blocks(x.w[o][i], j);
      exchange_blocks(sum[o]);
    }
    for (int s = 0; s < 3; ++s) out[s][j] = sum_over_x(weight[kSplineX[s]], sum[kSplineY[s]]);
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
    N y_sums[2][4];
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const N at(double{c[i * kQuad + j * g.plane + k]});
        for (int o = 0; o < 2; ++o)
          y_sums[o][i] = j == 0 ? y.w[o][0] * at : mul_add(y.w[o][j], at, y_sums[o][i]);
      }
    for (int s = 0; s < 3; ++s) out[s][k] = sum_over_x(x.w[kSplineX[s]], y_sums[kSplineY[s]]);
  }
}

/// Stores whole numbers as integers.
template <class A>
[[gnu::always_inline]] inline void store_whole(const LanesF<A>& x, int (&out)[kLanesF]) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    _mm512_store_si512(out, _mm512_cvttps_epi32(x.r[0]));
    return;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    for (int k = 0; k < 2; ++k)
      _mm256_store_si256(reinterpret_cast<__m256i*>(out + 8 * k), _mm256_cvttps_epi32(x.r[k]));
    return;
  }
#endif
  alignas(64) float all[kLanesF];
  store_lanes(x, all);
  for (int l = 0; l < kLanesF; ++l) out[l] = int(all[l]);
}

/// Sixteen points in single precision: φ and ∇φ where φ < 0, elsewhere some φ ≥ 0. Nothing is read
/// where `above` is nowhere negative. On a dense pad all of them are often in one cell. Then its
/// coefficients are read once, for the same sums.
template <class A>
void spline_inside(const DistanceGrid& g, const GridPlace<LanesF<A>>& at, const LanesF<A>& above,
                   SplineValue<LanesF<A>, 1>& out) {
  using N = LanesF<A>;
  const N zero(0.0);
  const auto nothing = [&] { out = {N(1.0), {zero, zero, zero}, {}}; };
  if (!any(above < zero)) return nothing();
  const N number = mul_add(at.whole[2], N(double(g.row / kQuad)),
                           mul_add(at.whole[1], N(double(g.plane / kQuad)), at.whole[0]));
  alignas(64) int cell[kLanesF];
  store_whole(number, cell);
  if (any(above < N(kNoBound / 2)) && !any_inside<A>(g.floors, cell)) return nothing();
  const N first(double{float(cell[0])});
  const SplineWeights<N, 1> x(at.rest[0]), y(at.rest[1]);
  N sums[3][4];
  if (any(number < first) || any(number > first)) {
    sum_places_f<A>(g, cell, x, y, sums);
  } else {
    sum_cell_f<A>(g.coefficients + std::ptrdiff_t(kQuad) * cell[0], g, x, y, sums);
  }
  sum_over_z<1>(sums, SplineWeights<N, 1>(at.rest[2]), out);
}

}  // namespace tangere::kernels
