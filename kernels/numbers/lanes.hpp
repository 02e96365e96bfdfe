// SPDX-License-Identifier: Apache-2.0
// Eight doubles, one per environment, on any instruction set: the number type that kernels run on.
//
// A group is always eight lanes, however wide the registers are, so that layout and results do not
// depend on the machine. Every operation acts lane by lane; nothing here mixes lanes except any().
// The scalar and SSE2 builds round a product before adding (mul_add(a, b, c) = a * b + c); AVX2 and
// AVX-512 fuse it, and agree with each other bit for bit.
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

/// Tag of the build that uses no SIMD type: plain loops over eight doubles, for other processors
/// and as a check.
struct ScalarArch {};

/// Registers of Arch holding eight lanes.
template <class Arch>
struct Lanes {
  using Batch = xsimd::batch<double, Arch>;
  static constexpr int kRegisters = kGroup / static_cast<int>(Batch::size);
  Batch r[kRegisters];

  Lanes() = default;
  Lanes(double x) {  // NOLINT(google-explicit-constructor): constants read like numbers
    for (int i = 0; i < kRegisters; ++i) r[i] = Batch(x);
  }
};

template <class Arch>
struct LaneMask {
  using Bool = xsimd::batch_bool<double, Arch>;
  static constexpr int kRegisters = kGroup / static_cast<int>(Lanes<Arch>::Batch::size);
  Bool r[kRegisters];
};

template <>
struct Lanes<ScalarArch> {
  double r[kGroup];
  static constexpr int kRegisters = kGroup;
  Lanes() = default;
  Lanes(double x) {  // NOLINT(google-explicit-constructor)
    for (double& v : r) v = x;
  }
};

template <>
struct LaneMask<ScalarArch> {
  bool r[kGroup];
  static constexpr int kRegisters = kGroup;
};

/// Whether mul_add rounds only once.
template <class Arch>
inline constexpr bool kFuses =
    std::is_same_v<Arch, xsimd::avx2> || std::is_same_v<Arch, xsimd::avx512bw>;

namespace detail {

// Each operation on one register. Overloads on double serve the scalar build.
inline double fuse(double a, double b, double c) { return a * b + c; }
inline double fuse_negated(double a, double b, double c) { return c - a * b; }
inline double choose(bool m, double a, double b) { return m ? a : b; }
inline double root(double a) { return std::sqrt(a); }
inline double magnitude(double a) { return std::fabs(a); }
inline double larger(double a, double b) { return a > b ? a : b; }
inline double smaller(double a, double b) { return a < b ? a : b; }
inline bool any_of(bool m) { return m; }
inline unsigned bits_of(bool m) { return m ? 1U : 0U; }

#if defined(__AVX2__) && defined(__FMA__)
inline xsimd::batch<double, xsimd::avx2> fuse(const xsimd::batch<double, xsimd::avx2>& a,
                                              const xsimd::batch<double, xsimd::avx2>& b,
                                              const xsimd::batch<double, xsimd::avx2>& c) {
  return _mm256_fmadd_pd(a, b, c);
}
inline xsimd::batch<double, xsimd::avx2> fuse_negated(const xsimd::batch<double, xsimd::avx2>& a,
                                                      const xsimd::batch<double, xsimd::avx2>& b,
                                                      const xsimd::batch<double, xsimd::avx2>& c) {
  return _mm256_fnmadd_pd(a, b, c);
}
inline unsigned bits_of(const xsimd::batch_bool<double, xsimd::avx2>& m) {
  return static_cast<unsigned>(_mm256_movemask_pd(m));
}
#endif
#if defined(__AVX512F__)
inline xsimd::batch<double, xsimd::avx512bw> fuse(const xsimd::batch<double, xsimd::avx512bw>& a,
                                                  const xsimd::batch<double, xsimd::avx512bw>& b,
                                                  const xsimd::batch<double, xsimd::avx512bw>& c) {
  return _mm512_fmadd_pd(a, b, c);
}
inline xsimd::batch<double, xsimd::avx512bw> fuse_negated(
    const xsimd::batch<double, xsimd::avx512bw>& a, const xsimd::batch<double, xsimd::avx512bw>& b,
    const xsimd::batch<double, xsimd::avx512bw>& c) {
  return _mm512_fnmadd_pd(a, b, c);
}
inline unsigned bits_of(const xsimd::batch_bool<double, xsimd::avx512bw>& m) {
  return static_cast<__mmask8>(m);
}
#endif
inline xsimd::batch<double, xsimd::sse2> fuse(const xsimd::batch<double, xsimd::sse2>& a,
                                              const xsimd::batch<double, xsimd::sse2>& b,
                                              const xsimd::batch<double, xsimd::sse2>& c) {
  return a * b + c;
}
inline xsimd::batch<double, xsimd::sse2> fuse_negated(const xsimd::batch<double, xsimd::sse2>& a,
                                                      const xsimd::batch<double, xsimd::sse2>& b,
                                                      const xsimd::batch<double, xsimd::sse2>& c) {
  return c - a * b;
}
inline unsigned bits_of(const xsimd::batch_bool<double, xsimd::sse2>& m) {
  return static_cast<unsigned>(_mm_movemask_pd(m));
}
template <class A>
xsimd::batch<double, A> choose(const xsimd::batch_bool<double, A>& m,
                               const xsimd::batch<double, A>& a, const xsimd::batch<double, A>& b) {
  return xsimd::select(m, a, b);
}
template <class A>
xsimd::batch<double, A> root(const xsimd::batch<double, A>& a) {
  return xsimd::sqrt(a);
}
template <class A>
xsimd::batch<double, A> magnitude(const xsimd::batch<double, A>& a) {
  return xsimd::abs(a);
}
// Written as a comparison so that NaN in a gives b on every instruction set.
template <class A>
xsimd::batch<double, A> larger(const xsimd::batch<double, A>& a, const xsimd::batch<double, A>& b) {
  return xsimd::select(a > b, a, b);
}
template <class A>
xsimd::batch<double, A> smaller(const xsimd::batch<double, A>& a,
                                const xsimd::batch<double, A>& b) {
  return xsimd::select(a < b, a, b);
}
template <class A>
bool any_of(const xsimd::batch_bool<double, A>& m) {
  return xsimd::any(m);
}

}  // namespace detail

#define TANGERE_LANES_BINARY(op)                                              \
  template <class A>                                                          \
  inline Lanes<A> operator op(const Lanes<A>& a, const Lanes<A>& b) {         \
    Lanes<A> c;                                                               \
    for (int i = 0; i < Lanes<A>::kRegisters; ++i) c.r[i] = a.r[i] op b.r[i]; \
    return c;                                                                 \
  }                                                                           \
  template <class A>                                                          \
  inline Lanes<A> operator op(const Lanes<A>& a, double b) {                  \
    return a op Lanes<A>(b);                                                  \
  }                                                                           \
  template <class A>                                                          \
  inline Lanes<A> operator op(double a, const Lanes<A>& b) {                  \
    return Lanes<A>(a) op b;                                                  \
  }
TANGERE_LANES_BINARY(+)
TANGERE_LANES_BINARY(-)
TANGERE_LANES_BINARY(*)
TANGERE_LANES_BINARY(/)
#undef TANGERE_LANES_BINARY

#define TANGERE_LANES_COMPARE(op)                                             \
  template <class A>                                                          \
  inline LaneMask<A> operator op(const Lanes<A>& a, const Lanes<A>& b) {      \
    LaneMask<A> m;                                                            \
    for (int i = 0; i < Lanes<A>::kRegisters; ++i) m.r[i] = a.r[i] op b.r[i]; \
    return m;                                                                 \
  }                                                                           \
  template <class A>                                                          \
  inline LaneMask<A> operator op(const Lanes<A>& a, double b) {               \
    return a op Lanes<A>(b);                                                  \
  }
TANGERE_LANES_COMPARE(<)
TANGERE_LANES_COMPARE(<=)
TANGERE_LANES_COMPARE(>)
TANGERE_LANES_COMPARE(>=)
#undef TANGERE_LANES_COMPARE

template <class A>
inline Lanes<A> operator-(const Lanes<A>& a) {
  Lanes<A> c;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) c.r[i] = -a.r[i];
  return c;
}
template <class A>
inline Lanes<A>& operator+=(Lanes<A>& a, const Lanes<A>& b) {
  return a = a + b;
}
template <class A>
inline Lanes<A>& operator-=(Lanes<A>& a, const Lanes<A>& b) {
  return a = a - b;
}
template <class A>
inline LaneMask<A> operator&(const LaneMask<A>& a, const LaneMask<A>& b) {
  LaneMask<A> m;
  for (int i = 0; i < LaneMask<A>::kRegisters; ++i) m.r[i] = a.r[i] && b.r[i];
  return m;
}
template <class A>
inline LaneMask<A> operator|(const LaneMask<A>& a, const LaneMask<A>& b) {
  LaneMask<A> m;
  for (int i = 0; i < LaneMask<A>::kRegisters; ++i) m.r[i] = a.r[i] || b.r[i];
  return m;
}

/// Returns a b + c, fused on AVX2 and AVX-512.
template <class A>
inline Lanes<A> mul_add(const Lanes<A>& a, const Lanes<A>& b, const Lanes<A>& c) {
  Lanes<A> d;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) d.r[i] = detail::fuse(a.r[i], b.r[i], c.r[i]);
  return d;
}
/// Returns c - a b.
template <class A>
inline Lanes<A> mul_sub_from(const Lanes<A>& a, const Lanes<A>& b, const Lanes<A>& c) {
  Lanes<A> d;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i)
    d.r[i] = detail::fuse_negated(a.r[i], b.r[i], c.r[i]);
  return d;
}
/// Returns m ? a : b, lane by lane.
template <class A>
inline Lanes<A> select(const LaneMask<A>& m, const Lanes<A>& a, const Lanes<A>& b) {
  Lanes<A> d;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) d.r[i] = detail::choose(m.r[i], a.r[i], b.r[i]);
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
/// Returns the larger; b where a is NaN.
template <class A>
inline Lanes<A> max(const Lanes<A>& a, const Lanes<A>& b) {
  Lanes<A> d;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) d.r[i] = detail::larger(a.r[i], b.r[i]);
  return d;
}
/// Returns the smaller; b where a is NaN.
template <class A>
inline Lanes<A> min(const Lanes<A>& a, const Lanes<A>& b) {
  Lanes<A> d;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) d.r[i] = detail::smaller(a.r[i], b.r[i]);
  return d;
}
template <class A>
inline bool any(const LaneMask<A>& m) {
  for (int i = 0; i < LaneMask<A>::kRegisters; ++i)
    if (detail::any_of(m.r[i])) return true;
  return false;
}

/// Bit l of the result is lane l.
template <class A>
inline unsigned lane_bits(const LaneMask<A>& m) {
  unsigned bits = 0;
  for (int i = 0; i < LaneMask<A>::kRegisters; ++i)
    bits |= detail::bits_of(m.r[i]) << (i * (kGroup / LaneMask<A>::kRegisters));
  return bits;
}

template <class A>
inline Lanes<A> load_lanes(const double* p) {  // 64-byte aligned
  Lanes<A> d;
  constexpr int w = kGroup / Lanes<A>::kRegisters;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) {
    if constexpr (w == 1) {
      d.r[i] = p[i];
    } else {
      d.r[i] = Lanes<A>::Batch::load_aligned(p + i * w);
    }
  }
  return d;
}
template <class A>
inline Lanes<A> load_lanes_anywhere(const double* p) {
  Lanes<A> d;
  constexpr int w = kGroup / Lanes<A>::kRegisters;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) {
    if constexpr (w == 1) {
      d.r[i] = p[i];
    } else {
      d.r[i] = Lanes<A>::Batch::load_unaligned(p + i * w);
    }
  }
  return d;
}
template <class A>
inline void store_lanes(const Lanes<A>& d, double* p) {  // 64-byte aligned
  constexpr int w = kGroup / Lanes<A>::kRegisters;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) {
    if constexpr (w == 1) {
      p[i] = d.r[i];
    } else {
      d.r[i].store_aligned(p + i * w);
    }
  }
}

/// Returns the nearest integer, ties to even, for |a| < 2^51: adding 1.5 · 2^52 leaves no bits for
/// a fraction.
template <class A>
inline Lanes<A> round_nearest(const Lanes<A>& a) {
  const Lanes<A> shift(6755399441055744.0);
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
