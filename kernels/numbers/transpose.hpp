// SPDX-License-Identifier: Apache-2.0
// Transposes eight rows of eight numbers: vectors of points to vectors of environments.
#pragma once

#include "kernels/numbers/lanes.hpp"

namespace tangere::kernels {

#if defined(__AVX2__)
/// Transposes four rows of four numbers. It is always inlined, because sources of several
/// instruction sets contain it.
[[gnu::always_inline]] inline void transpose_four(__m256d (&x)[4]) {
  const __m256d low01 = _mm256_unpacklo_pd(x[0], x[1]), high01 = _mm256_unpackhi_pd(x[0], x[1]),
                low23 = _mm256_unpacklo_pd(x[2], x[3]), high23 = _mm256_unpackhi_pd(x[2], x[3]);
  x[0] = _mm256_permute2f128_pd(low01, low23, 0x20);
  x[1] = _mm256_permute2f128_pd(high01, high23, 0x20);
  x[2] = _mm256_permute2f128_pd(low01, low23, 0x31);
  x[3] = _mm256_permute2f128_pd(high01, high23, 0x31);
}
#endif

/// Number j of row i becomes number i of row j.
template <class A>
inline void transpose(Lanes<A> (&x)[kGroup]) {
#if defined(__AVX512F__)
  if constexpr (std::is_same_v<A, xsimd::avx512bw>) {
    __m512d pairs[2][4];  // numbers 0 2 4 6, then 1 3 5 7, of rows 2 i and 2 i + 1
    for (int i = 0; i < 4; ++i) {
      pairs[0][i] = _mm512_unpacklo_pd(x[2 * i].r[0], x[2 * i + 1].r[0]);
      pairs[1][i] = _mm512_unpackhi_pd(x[2 * i].r[0], x[2 * i + 1].r[0]);
    }
    for (int odd = 0; odd < 2; ++odd) {
      const __m512d* p = pairs[odd];
      const __m512d low04 = _mm512_shuffle_f64x2(p[0], p[1], 0x88),
                    low26 = _mm512_shuffle_f64x2(p[0], p[1], 0xdd),
                    high04 = _mm512_shuffle_f64x2(p[2], p[3], 0x88),
                    high26 = _mm512_shuffle_f64x2(p[2], p[3], 0xdd);
      x[odd].r[0] = _mm512_shuffle_f64x2(low04, high04, 0x88);
      x[odd + 4].r[0] = _mm512_shuffle_f64x2(low04, high04, 0xdd);
      x[odd + 2].r[0] = _mm512_shuffle_f64x2(low26, high26, 0x88);
      x[odd + 6].r[0] = _mm512_shuffle_f64x2(low26, high26, 0xdd);
    }
    return;
  }
#endif
#if defined(__AVX2__)
  if constexpr (std::is_same_v<A, xsimd::avx2>) {
    __m256d block[2][2][4];  // rows 4 i to 4 i + 3, register j
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) {
        for (int k = 0; k < 4; ++k) block[i][j][k] = x[4 * i + k].r[j];
        transpose_four(block[i][j]);
      }
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j)
        for (int k = 0; k < 4; ++k) x[4 * j + k].r[i] = block[i][j][k];
    return;
  }
#endif
  alignas(64) double rows[kGroup][kGroup], columns[kGroup][kGroup];
  for (int i = 0; i < kGroup; ++i) store_lanes(x[i], rows[i]);
  for (int i = 0; i < kGroup; ++i)
    for (int j = 0; j < kGroup; ++j) columns[j][i] = rows[i][j];
  for (int i = 0; i < kGroup; ++i) x[i] = load_lanes<A>(columns[i]);
}

}  // namespace tangere::kernels
