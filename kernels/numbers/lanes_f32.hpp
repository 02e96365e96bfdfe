// SPDX-License-Identifier: Apache-2.0
// Sixteen floats: points of a tile, or the environments of a block, in single precision. The rules
// of kernels/numbers/lanes.hpp hold.
#pragma once

#include <cstdint>

#include "kernels/numbers/lanes.hpp"

namespace tangere::kernels {

template <class Arch>
using LanesF = BasicLanes<float, Arch>;
template <class Arch>
using MaskF = BasicLaneMask<float, Arch>;
inline constexpr int kLanesF = LanesF<ScalarArch>::kLanes;

namespace detail {

inline constexpr std::uint32_t kInverseSqrtSeedF = 0x5F375A86U;
inline float inverse_sqrt_seed(float x) {
  return __builtin_bit_cast(float, kInverseSqrtSeedF - (__builtin_bit_cast(std::uint32_t, x) >> 1));
}
template <class A>
xsimd::batch<float, A> inverse_sqrt_seed(const xsimd::batch<float, A>& x) {
  using Integers = xsimd::batch<std::uint32_t, A>;
  const Integers half = xsimd::bitwise_cast<Integers>(x) >> 1;
  return xsimd::bitwise_cast<xsimd::batch<float, A>>(Integers(kInverseSqrtSeedF) - half);
}

#if defined(__SSE2__)
inline xsimd::batch<float, xsimd::sse2> narrow(const Lanes<xsimd::sse2>& x, int k) {
  return _mm_movelh_ps(_mm_cvtpd_ps(x.r[2 * k]), _mm_cvtpd_ps(x.r[2 * k + 1]));
}
#endif
#if defined(__AVX2__) && defined(__FMA__)
inline FloatAvx2 narrow(const Lanes<xsimd::avx2>& x, int k) {
  return _mm256_set_m128(_mm256_cvtpd_ps(x.r[2 * k + 1]), _mm256_cvtpd_ps(x.r[2 * k]));
}
#endif

}  // namespace detail

/// Rounds two groups of eight doubles to the sixteen floats of their block.
template <class A>
inline LanesF<A> narrow(const Lanes<A>& low, const Lanes<A>& high) {
  LanesF<A> d;
  if constexpr (LanesF<A>::kRegisters == 1) {
#if defined(__AVX512F__)
    const __m512 both = _mm512_castps256_ps512(_mm512_cvtpd_ps(low.r[0]));
    d.r[0] = _mm512_castpd_ps(_mm512_insertf64x4(_mm512_castps_pd(both),
                                                 _mm256_castps_pd(_mm512_cvtpd_ps(high.r[0])), 1));
#endif
  } else if constexpr (LanesF<A>::kRegisters == kLanesF) {
    for (int i = 0; i < kGroup; ++i) {
      d.r[i] = static_cast<float>(low.r[i]);
      d.r[kGroup + i] = static_cast<float>(high.r[i]);
    }
  } else {
    constexpr int half = LanesF<A>::kRegisters / 2;
    for (int i = 0; i < half; ++i) {
      d.r[i] = detail::narrow(low, i);
      d.r[half + i] = detail::narrow(high, i);
    }
  }
  return d;
}

/// Returns 1/√x for normal, positive, finite x, with relative error at most 2e-7: an integer seed,
/// e = 1 - x y², then (1 - e)^-½ by the polynomial that is best for |e| < 0.07 (2.6e-8 relative).
template <class A>
inline LanesF<A> inverse_sqrt(const LanesF<A>& x) {
  LanesF<A> y;
  for (int i = 0; i < LanesF<A>::kRegisters; ++i) y.r[i] = detail::inverse_sqrt_seed(x.r[i]);
  const LanesF<A> e = mul_sub_from(x * y, y, LanesF<A>(1.0));
  LanesF<A> series = mul_add(e, LanesF<A>(0.2739890306), LanesF<A>(0.3139393815));
  series = mul_add(e, series, LanesF<A>(0.3750007011));
  series = mul_add(e, series, LanesF<A>(0.4999983200));
  return mul_add(y * e, series, y);
}

}  // namespace tangere::kernels
