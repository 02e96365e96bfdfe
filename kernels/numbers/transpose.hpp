// SPDX-License-Identifier: Apache-2.0
// Transposes eight rows of eight numbers: vectors of points to vectors of environments.
#pragma once

#include "kernels/numbers/lanes.hpp"

namespace tangere::kernels {

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
  alignas(64) double rows[kGroup][kGroup], columns[kGroup][kGroup];
  for (int i = 0; i < kGroup; ++i) store_lanes(x[i], rows[i]);
  for (int i = 0; i < kGroup; ++i)
    for (int j = 0; j < kGroup; ++j) columns[j][i] = rows[i][j];
  for (int i = 0; i < kGroup; ++i) x[i] = load_lanes<A>(columns[i]);
}

}  // namespace tangere::kernels
