// SPDX-License-Identifier: Apache-2.0
// Eight doubles, one per environment, or sixteen floats, on any instruction set: the number types
// that kernels run on.
//
// Lanes fill 64 bytes, however wide the registers are, so that layout and results do not depend on
// the machine. Every operation acts lane by lane; nothing here mixes lanes except any(). The scalar
// and SSE2 builds round a product before adding (mul_add(a, b, c) = a * b + c); AVX2 and AVX-512
// fuse it, and agree with each other bit for bit.
#pragma once

#include <cmath>
#include <cstddef>
#include <type_traits>
#include <xsimd/xsimd.hpp>

#include "kernels/numbers/block.hpp"

namespace tangere::kernels {

/// One number of a group of L environments in memory. Engine code indexes it; kernels read it as
/// Lanes, or as OneLane.
template <int L>
struct alignas(8 * L) Row {
  double lane[L];
  double& operator[](int l) { return lane[l]; }
  const double& operator[](int l) const { return lane[l]; }
  static Row all(double x) {
    Row row;
    for (double& y : row.lane) y = x;
    return row;
  }
};

using LaneRow = Row<kGroup>;

/// Tag of the build that uses no SIMD type: plain loops over numbers, for other processors and as a
/// check.
struct ScalarArch {};

/// Whether mul_add rounds only once.
template <class Arch>
inline constexpr bool kFuses =
    std::is_same_v<Arch, xsimd::avx2> || std::is_same_v<Arch, xsimd::avx512bw>;

namespace detail {

/// One register of numbers T.
template <class T, class Arch>
struct Register {
  using Type = xsimd::batch<T, Arch>;
  using Mask = xsimd::batch_bool<T, Arch>;
  static constexpr int kWidth = static_cast<int>(Type::size);
};
template <class T>
struct Register<T, ScalarArch> {
  using Type = T;
  using Mask = bool;
  static constexpr int kWidth = 1;
};

}  // namespace detail

/// Registers of Arch that hold 64 bytes of numbers T.
template <class T, class Arch>
struct BasicLanes {
  using Register = typename detail::Register<T, Arch>::Type;
  static constexpr int kLanes = 64 / static_cast<int>(sizeof(T));
  static constexpr int kWidth = detail::Register<T, Arch>::kWidth, kRegisters = kLanes / kWidth;
  Register r[kRegisters];

  BasicLanes() = default;
  BasicLanes(double x) {  // NOLINT(google-explicit-constructor): constants read like numbers
    for (Register& v : r) v = Register(static_cast<T>(x));
  }
};
template <class T, class Arch>
struct BasicLaneMask {
  typename detail::Register<T, Arch>::Mask r[BasicLanes<T, Arch>::kRegisters];
};

template <class Arch>
using Lanes = BasicLanes<double, Arch>;
template <class Arch>
using LaneMask = BasicLaneMask<double, Arch>;
static_assert(Lanes<ScalarArch>::kLanes == kGroup);

namespace detail {

// Products of vector registers that round once. They are always inlined: sources of several
// instruction sets contain them.
#define TANGERE_FUSED(type, fused, negated)                                                      \
  [[gnu::always_inline]] inline type fuse(const type& a, const type& b, const type& c) {         \
    return fused(a, b, c);                                                                       \
  }                                                                                              \
  [[gnu::always_inline]] inline type fuse_negated(const type& a, const type& b, const type& c) { \
    return negated(a, b, c);                                                                     \
  }
#if defined(__AVX2__) && defined(__FMA__)
using DoubleAvx2 = xsimd::batch<double, xsimd::avx2>;
using FloatAvx2 = xsimd::batch<float, xsimd::avx2>;
TANGERE_FUSED(DoubleAvx2, _mm256_fmadd_pd, _mm256_fnmadd_pd)
TANGERE_FUSED(FloatAvx2, _mm256_fmadd_ps, _mm256_fnmadd_ps)
#endif
#if defined(__AVX512F__)
using DoubleAvx512 = xsimd::batch<double, xsimd::avx512bw>;
using FloatAvx512 = xsimd::batch<float, xsimd::avx512bw>;
TANGERE_FUSED(DoubleAvx512, _mm512_fmadd_pd, _mm512_fnmadd_pd)
TANGERE_FUSED(FloatAvx512, _mm512_fmadd_ps, _mm512_fnmadd_ps)
#endif
#undef TANGERE_FUSED

// The same on one register. Functions on T serve the scalar build.
template <class T>
requires std::is_floating_point_v<T> T fuse(T a, T b, T c) { return a * b + c; }
template <class T>
requires std::is_floating_point_v<T> T fuse_negated(T a, T b, T c) { return c - a * b; }
template <class T>
xsimd::batch<T, xsimd::sse2> fuse(const xsimd::batch<T, xsimd::sse2>& a,
                                  const xsimd::batch<T, xsimd::sse2>& b,
                                  const xsimd::batch<T, xsimd::sse2>& c) {
  return a * b + c;
}
template <class T>
xsimd::batch<T, xsimd::sse2> fuse_negated(const xsimd::batch<T, xsimd::sse2>& a,
                                          const xsimd::batch<T, xsimd::sse2>& b,
                                          const xsimd::batch<T, xsimd::sse2>& c) {
  return c - a * b;
}
template <class T>
requires std::is_floating_point_v<T> T choose(bool m, T a, T b) { return m ? a : b; }
template <class T, class A>
xsimd::batch<T, A> choose(const xsimd::batch_bool<T, A>& m, const xsimd::batch<T, A>& a,
                          const xsimd::batch<T, A>& b) {
  return xsimd::select(m, a, b);
}
inline double root(double a) { return std::sqrt(a); }
template <class A>
xsimd::batch<double, A> root(const xsimd::batch<double, A>& a) {
  return xsimd::sqrt(a);
}
inline double magnitude(double a) { return std::fabs(a); }
template <class A>
xsimd::batch<double, A> magnitude(const xsimd::batch<double, A>& a) {
  return xsimd::abs(a);
}
// maxpd and minpd return the second operand where either is NaN, as the comparison does.
template <class T>
requires std::is_floating_point_v<T> T larger(T a, T b) { return a > b ? a : b; }
template <class T, class A>
xsimd::batch<T, A> larger(const xsimd::batch<T, A>& a, const xsimd::batch<T, A>& b) {
  return xsimd::max(a, b);
}
template <class T>
requires std::is_floating_point_v<T> T smaller(T a, T b) { return a < b ? a : b; }
template <class T, class A>
xsimd::batch<T, A> smaller(const xsimd::batch<T, A>& a, const xsimd::batch<T, A>& b) {
  return xsimd::min(a, b);
}
inline bool any_of(bool m) { return m; }
template <class T, class A>
bool any_of(const xsimd::batch_bool<T, A>& m) {
  return xsimd::any(m);
}
inline unsigned bits_of(bool m) { return m ? 1U : 0U; }
inline unsigned bits_of(const xsimd::batch_bool<double, xsimd::sse2>& m) {
  return static_cast<unsigned>(_mm_movemask_pd(m));
}
#if defined(__AVX2__)
inline unsigned bits_of(const xsimd::batch_bool<double, xsimd::avx2>& m) {
  return static_cast<unsigned>(_mm256_movemask_pd(m));
}
#endif
#if defined(__AVX512F__)
inline unsigned bits_of(const xsimd::batch_bool<double, xsimd::avx512bw>& m) {
  return static_cast<__mmask8>(m);
}
#endif

}  // namespace detail

#define TANGERE_LANES_BINARY(op, Result)                                                  \
  template <class T, class A>                                                             \
  inline Result<T, A> operator op(const BasicLanes<T, A>& a, const BasicLanes<T, A>& b) { \
    Result<T, A> c;                                                                       \
    for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i) c.r[i] = a.r[i] op b.r[i];     \
    return c;                                                                             \
  }                                                                                       \
  template <class T, class A>                                                             \
  inline Result<T, A> operator op(const BasicLanes<T, A>& a, double b) {                  \
    return a op BasicLanes<T, A>(b);                                                      \
  }                                                                                       \
  template <class T, class A>                                                             \
  inline Result<T, A> operator op(double a, const BasicLanes<T, A>& b) {                  \
    return BasicLanes<T, A>(a) op b;                                                      \
  }
TANGERE_LANES_BINARY(+, BasicLanes)
TANGERE_LANES_BINARY(-, BasicLanes)
TANGERE_LANES_BINARY(*, BasicLanes)
TANGERE_LANES_BINARY(/, BasicLanes)
TANGERE_LANES_BINARY(<, BasicLaneMask)
TANGERE_LANES_BINARY(<=, BasicLaneMask)
TANGERE_LANES_BINARY(>, BasicLaneMask)
TANGERE_LANES_BINARY(>=, BasicLaneMask)
#undef TANGERE_LANES_BINARY

template <class T, class A>
inline BasicLanes<T, A> operator-(const BasicLanes<T, A>& a) {
  BasicLanes<T, A> c;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i) c.r[i] = -a.r[i];
  return c;
}
template <class T, class A>
inline BasicLanes<T, A>& operator+=(BasicLanes<T, A>& a, const BasicLanes<T, A>& b) {
  return a = a + b;
}
template <class T, class A>
inline BasicLanes<T, A>& operator-=(BasicLanes<T, A>& a, const BasicLanes<T, A>& b) {
  return a = a - b;
}
template <class T, class A>
inline BasicLaneMask<T, A> operator&(const BasicLaneMask<T, A>& a, const BasicLaneMask<T, A>& b) {
  BasicLaneMask<T, A> m;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i) m.r[i] = a.r[i] && b.r[i];
  return m;
}
template <class T, class A>
inline BasicLaneMask<T, A> operator|(const BasicLaneMask<T, A>& a, const BasicLaneMask<T, A>& b) {
  BasicLaneMask<T, A> m;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i) m.r[i] = a.r[i] || b.r[i];
  return m;
}

/// Returns a b + c, fused on AVX2 and AVX-512.
template <class T, class A>
inline BasicLanes<T, A> mul_add(const BasicLanes<T, A>& a, const BasicLanes<T, A>& b,
                                const BasicLanes<T, A>& c) {
  BasicLanes<T, A> d;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i)
    d.r[i] = detail::fuse(a.r[i], b.r[i], c.r[i]);
  return d;
}
/// Returns c - a b.
template <class T, class A>
inline BasicLanes<T, A> mul_sub_from(const BasicLanes<T, A>& a, const BasicLanes<T, A>& b,
                                     const BasicLanes<T, A>& c) {
  BasicLanes<T, A> d;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i)
    d.r[i] = detail::fuse_negated(a.r[i], b.r[i], c.r[i]);
  return d;
}
/// Returns m ? a : b, lane by lane.
template <class T, class A>
inline BasicLanes<T, A> select(const BasicLaneMask<T, A>& m, const BasicLanes<T, A>& a,
                               const BasicLanes<T, A>& b) {
  BasicLanes<T, A> d;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i)
    d.r[i] = detail::choose(m.r[i], a.r[i], b.r[i]);
  return d;
}
template <class A>
inline Lanes<A> sqrt(const Lanes<A>& a) {
  Lanes<A> d;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) d.r[i] = detail::root(a.r[i]);
  return d;
}
template <class A>
inline Lanes<A> abs(const Lanes<A>& a) {
  Lanes<A> d;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) d.r[i] = detail::magnitude(a.r[i]);
  return d;
}
/// Returns the larger; b where either is NaN.
template <class T, class A>
inline BasicLanes<T, A> max(const BasicLanes<T, A>& a, const BasicLanes<T, A>& b) {
  BasicLanes<T, A> d;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i) d.r[i] = detail::larger(a.r[i], b.r[i]);
  return d;
}
/// Returns the smaller; b where either is NaN.
template <class T, class A>
inline BasicLanes<T, A> min(const BasicLanes<T, A>& a, const BasicLanes<T, A>& b) {
  BasicLanes<T, A> d;
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i) d.r[i] = detail::smaller(a.r[i], b.r[i]);
  return d;
}
template <class T, class A>
inline bool any(const BasicLaneMask<T, A>& m) {
  for (int i = 0; i < BasicLanes<T, A>::kRegisters; ++i)
    if (detail::any_of(m.r[i])) return true;
  return false;
}

/// Bit l of the result is lane l.
template <class A>
inline unsigned lane_bits(const LaneMask<A>& m) {
  unsigned bits = 0;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i)
    bits |= detail::bits_of(m.r[i]) << (i * Lanes<A>::kWidth);
  return bits;
}

template <class A, class T>
inline BasicLanes<T, A> load_lanes(const T* p) {  // 64-byte aligned
  using To = BasicLanes<T, A>;
  To d;
  for (int i = 0; i < To::kRegisters; ++i) {
    if constexpr (To::kWidth == 1) {
      d.r[i] = p[i];
    } else {
      d.r[i] = To::Register::load_aligned(p + i * To::kWidth);
    }
  }
  return d;
}
template <class A>
inline Lanes<A> load_lanes_anywhere(const double* p) {
  using To = Lanes<A>;
  To d;
  for (int i = 0; i < To::kRegisters; ++i) {
    if constexpr (To::kWidth == 1) {
      d.r[i] = p[i];
    } else {
      d.r[i] = To::Register::load_unaligned(p + i * To::kWidth);
    }
  }
  return d;
}
template <class T, class A>
inline void store_lanes(const BasicLanes<T, A>& d, T* p) {  // 64-byte aligned
  using From = BasicLanes<T, A>;
  for (int i = 0; i < From::kRegisters; ++i) {
    if constexpr (From::kWidth == 1) {
      p[i] = d.r[i];
    } else {
      d.r[i].store_aligned(p + i * From::kWidth);
    }
  }
}

/// Returns the nearest integer, ties to even, for |a| < 2^51 (floats: 2^22): adding 1.5 · 2^52
/// (1.5 · 2^23) leaves no bits for a fraction.
template <class T, class A>
inline BasicLanes<T, A> round_nearest(const BasicLanes<T, A>& a) {
  const BasicLanes<T, A> shift(sizeof(T) == sizeof(double) ? 6755399441055744.0 : 12582912.0);
  return (a + shift) - shift;
}

// The same names on plain double, so that templates over the number type also run on it, as the
// scalar reference.
inline double mul_add(double a, double b, double c) { return a * b + c; }
inline double mul_sub_from(double a, double b, double c) { return c - a * b; }
inline double select(bool m, double a, double b) { return m ? a : b; }
inline double sqrt(double a) { return std::sqrt(a); }
inline double abs(double a) { return std::fabs(a); }
inline double max(double a, double b) { return a > b ? a : b; }
inline double min(double a, double b) { return a < b ? a : b; }
inline bool any(bool m) { return m; }
inline double round_nearest(double a) { return (a + 6755399441055744.0) - 6755399441055744.0; }

}  // namespace tangere::kernels
