// SPDX-License-Identifier: Apache-2.0
// Sixteen floats on any instruction set: points of a tile, or the environments of a block, in
// single precision.
//
// The rules of lanes.hpp hold: sixteen lanes however wide the registers are, and every operation
// lane by lane. Only mul_add fuses products, and only on AVX2 and AVX-512, which agree bit for bit.
#pragma once

#include <cstdint>

#include "kernels/numbers/lanes.hpp"

namespace tangere::kernels {

inline constexpr int kLanesF = 16;  ///< lanes of single precision: one AVX-512 register

namespace detail {

// One register of each instruction set, of which the lanes below are made.
template <class Arch>
struct RegisterF {
  using Type = xsimd::batch<float, Arch>;
  using Mask = xsimd::batch_bool<float, Arch>;
  static constexpr int kWidth = static_cast<int>(Type::size);
};
template <>
struct RegisterF<ScalarArch> {
  using Type = float;
  using Mask = bool;
  static constexpr int kWidth = 1;
};

inline constexpr std::uint32_t kInverseSqrtSeedF = 0x5F375A86U;

inline float fuse(float a, float b, float c) { return a * b + c; }
inline float fuse_negated(float a, float b, float c) { return c - a * b; }
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }
inline float choose(bool m, float a, float b) { return m ? a : b; }
inline float inverse_sqrt_seed(float x) {
  return __builtin_bit_cast(float, kInverseSqrtSeedF - (__builtin_bit_cast(std::uint32_t, x) >> 1));
}

// maxps and minps return the second operand when either is NaN, as the comparison above does.
#if defined(__SSE2__)
using FloatSse = xsimd::batch<float, xsimd::sse2>;
inline FloatSse fuse(const FloatSse& a, const FloatSse& b, const FloatSse& c) { return a * b + c; }
inline FloatSse fuse_negated(const FloatSse& a, const FloatSse& b, const FloatSse& c) {
  return c - a * b;
}
inline FloatSse larger(const FloatSse& a, const FloatSse& b) { return _mm_max_ps(a, b); }
inline FloatSse smaller(const FloatSse& a, const FloatSse& b) { return _mm_min_ps(a, b); }
inline FloatSse inverse_sqrt_seed(const FloatSse& x) {
  const __m128i half = _mm_srli_epi32(_mm_castps_si128(x), 1);
  return _mm_castsi128_ps(_mm_sub_epi32(_mm_set1_epi32(static_cast<int>(kInverseSqrtSeedF)), half));
}
inline FloatSse narrow(const Lanes<xsimd::sse2>& x, int k, FloatSse) {
  return _mm_movelh_ps(_mm_cvtpd_ps(x.r[2 * k]), _mm_cvtpd_ps(x.r[2 * k + 1]));
}
#endif
#if defined(__AVX2__) && defined(__FMA__)
using FloatAvx2 = xsimd::batch<float, xsimd::avx2>;
inline FloatAvx2 fuse(const FloatAvx2& a, const FloatAvx2& b, const FloatAvx2& c) {
  return _mm256_fmadd_ps(a, b, c);
}
inline FloatAvx2 fuse_negated(const FloatAvx2& a, const FloatAvx2& b, const FloatAvx2& c) {
  return _mm256_fnmadd_ps(a, b, c);
}
inline FloatAvx2 larger(const FloatAvx2& a, const FloatAvx2& b) { return _mm256_max_ps(a, b); }
inline FloatAvx2 smaller(const FloatAvx2& a, const FloatAvx2& b) { return _mm256_min_ps(a, b); }
inline FloatAvx2 inverse_sqrt_seed(const FloatAvx2& x) {
  const __m256i half = _mm256_srli_epi32(_mm256_castps_si256(x), 1);
  return _mm256_castsi256_ps(
      _mm256_sub_epi32(_mm256_set1_epi32(static_cast<int>(kInverseSqrtSeedF)), half));
}
inline FloatAvx2 narrow(const Lanes<xsimd::avx2>& x, int k, FloatAvx2) {
  return _mm256_set_m128(_mm256_cvtpd_ps(x.r[2 * k + 1]), _mm256_cvtpd_ps(x.r[2 * k]));
}
#endif
#if defined(__AVX512F__)
using FloatAvx512 = xsimd::batch<float, xsimd::avx512bw>;
inline FloatAvx512 fuse(const FloatAvx512& a, const FloatAvx512& b, const FloatAvx512& c) {
  return _mm512_fmadd_ps(a, b, c);
}
inline FloatAvx512 fuse_negated(const FloatAvx512& a, const FloatAvx512& b, const FloatAvx512& c) {
  return _mm512_fnmadd_ps(a, b, c);
}
inline FloatAvx512 larger(const FloatAvx512& a, const FloatAvx512& b) {
  return _mm512_max_ps(a, b);
}
inline FloatAvx512 smaller(const FloatAvx512& a, const FloatAvx512& b) {
  return _mm512_min_ps(a, b);
}
inline FloatAvx512 inverse_sqrt_seed(const FloatAvx512& x) {
  const __m512i half = _mm512_srli_epi32(_mm512_castps_si512(x), 1);
  return _mm512_castsi512_ps(
      _mm512_sub_epi32(_mm512_set1_epi32(static_cast<int>(kInverseSqrtSeedF)), half));
}
#endif
template <class A>
xsimd::batch<float, A> choose(const xsimd::batch_bool<float, A>& m, const xsimd::batch<float, A>& a,
                              const xsimd::batch<float, A>& b) {
  return xsimd::select(m, a, b);
}
template <class A>
bool any_of(const xsimd::batch_bool<float, A>& m) {
  return xsimd::any(m);
}

}  // namespace detail

template <class Arch>
struct LanesF {
  using Register = typename detail::RegisterF<Arch>::Type;
  static constexpr int kRegisters = kLanesF / detail::RegisterF<Arch>::kWidth;
  Register r[kRegisters];

  LanesF() = default;
  LanesF(double x) {  // NOLINT(google-explicit-constructor): constants read like numbers
    for (Register& v : r) v = Register(static_cast<float>(x));
  }
};

template <class Arch>
struct MaskF {
  typename detail::RegisterF<Arch>::Mask r[LanesF<Arch>::kRegisters];
};

#define TANGERE_LANES_F(name, result, expression)                        \
  template <class A>                                                     \
  inline result<A> name(const LanesF<A>& a, const LanesF<A>& b) {        \
    result<A> c;                                                         \
    for (int i = 0; i < LanesF<A>::kRegisters; ++i) c.r[i] = expression; \
    return c;                                                            \
  }
TANGERE_LANES_F(operator+, LanesF, a.r[i] + b.r[i])
TANGERE_LANES_F(operator-, LanesF, a.r[i] - b.r[i])
TANGERE_LANES_F(operator*, LanesF, a.r[i] * b.r[i])
TANGERE_LANES_F(operator<, MaskF, a.r[i] < b.r[i])
TANGERE_LANES_F(operator>, MaskF, a.r[i] > b.r[i])
TANGERE_LANES_F(operator>=, MaskF, a.r[i] >= b.r[i])
TANGERE_LANES_F(max, LanesF, detail::larger(a.r[i], b.r[i]))   // b where either is NaN
TANGERE_LANES_F(min, LanesF, detail::smaller(a.r[i], b.r[i]))  // b where either is NaN
#undef TANGERE_LANES_F

template <class A>
inline MaskF<A> operator&(const MaskF<A>& a, const MaskF<A>& b) {
  MaskF<A> m;
  for (int i = 0; i < LanesF<A>::kRegisters; ++i) m.r[i] = a.r[i] && b.r[i];
  return m;
}
/// Returns a b + c, fused on AVX2 and AVX-512.
template <class A>
inline LanesF<A> mul_add(const LanesF<A>& a, const LanesF<A>& b, const LanesF<A>& c) {
  LanesF<A> d;
  for (int i = 0; i < LanesF<A>::kRegisters; ++i) d.r[i] = detail::fuse(a.r[i], b.r[i], c.r[i]);
  return d;
}
/// Returns c - a b.
template <class A>
inline LanesF<A> mul_sub_from(const LanesF<A>& a, const LanesF<A>& b, const LanesF<A>& c) {
  LanesF<A> d;
  for (int i = 0; i < LanesF<A>::kRegisters; ++i)
    d.r[i] = detail::fuse_negated(a.r[i], b.r[i], c.r[i]);
  return d;
}
/// Returns m ? a : b, lane by lane.
template <class A>
inline LanesF<A> select(const MaskF<A>& m, const LanesF<A>& a, const LanesF<A>& b) {
  LanesF<A> d;
  for (int i = 0; i < LanesF<A>::kRegisters; ++i) d.r[i] = detail::choose(m.r[i], a.r[i], b.r[i]);
  return d;
}
template <class A>
inline bool any(const MaskF<A>& m) {
  for (int i = 0; i < LanesF<A>::kRegisters; ++i)
    if (detail::any_of(m.r[i])) return true;
  return false;
}

template <class A>
inline LanesF<A> load_lanes_f(const float* p) {  // 64-byte aligned
  LanesF<A> d;
  constexpr int w = detail::RegisterF<A>::kWidth;
  for (int i = 0; i < LanesF<A>::kRegisters; ++i) {
    if constexpr (w == 1) {
      d.r[i] = p[i];
    } else {
      d.r[i] = LanesF<A>::Register::load_aligned(p + i * w);
    }
  }
  return d;
}
template <class A>
inline void store_lanes_f(const LanesF<A>& d, float* p) {  // 64-byte aligned
  constexpr int w = detail::RegisterF<A>::kWidth;
  for (int i = 0; i < LanesF<A>::kRegisters; ++i) {
    if constexpr (w == 1) {
      p[i] = d.r[i];
    } else {
      d.r[i].store_aligned(p + i * w);
    }
  }
}

/// Returns the nearest integer, ties to even, for |a| < 2^22, as for doubles.
template <class A>
inline LanesF<A> round_nearest(const LanesF<A>& a) {
  const LanesF<A> shift(12582912.0);
  return (a + shift) - shift;
}

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
      d.r[i] = detail::narrow(low, i, typename LanesF<A>::Register{});
      d.r[half + i] = detail::narrow(high, i, typename LanesF<A>::Register{});
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
