// SPDX-License-Identifier: Apache-2.0
// Two vectors side by side as one number. The force on a point is a chain of some 150 cycles, and a
// processor keeps about a hundred operations in flight. Two interleaved independent chains take
// half the time of two in a row.
#pragma once

#include "kernels/tactile/tactile_point.hpp"

namespace tangere::kernels {

template <class N>
struct Twice {
  N a, b;
  Twice() = default;
  Twice(double x)
      : a(x), b(x) {}  // NOLINT(google-explicit-constructor): constants read like numbers
  Twice(const N& first, const N& second) : a(first), b(second) {}
};
template <class M>
struct TwiceMask {
  M a, b;
};

#define TANGERE_TWICE(name)                                    \
  template <class N>                                           \
  inline Twice<N> name(const Twice<N>& x, const Twice<N>& y) { \
    return {name(x.a, y.a), name(x.b, y.b)};                   \
  }
TANGERE_TWICE(operator+)
TANGERE_TWICE(operator-)
TANGERE_TWICE(operator*)
TANGERE_TWICE(min)
TANGERE_TWICE(max)
#undef TANGERE_TWICE

#define TANGERE_TWICE_COMPARE(op)                                   \
  template <class N>                                                \
  inline auto operator op(const Twice<N>& x, const Twice<N>& y) {   \
    return TwiceMask<decltype(x.a op y.a)>{x.a op y.a, x.b op y.b}; \
  }
TANGERE_TWICE_COMPARE(<)
TANGERE_TWICE_COMPARE(>)
TANGERE_TWICE_COMPARE(>=)
#undef TANGERE_TWICE_COMPARE

template <class M>
inline TwiceMask<M> operator&(const TwiceMask<M>& x, const TwiceMask<M>& y) {
  return {x.a & y.a, x.b & y.b};
}
template <class M>
inline bool any(const TwiceMask<M>& m) {
  return any(m.a) || any(m.b);
}
template <class N>
inline Twice<N> mul_add(const Twice<N>& x, const Twice<N>& y, const Twice<N>& z) {
  return {mul_add(x.a, y.a, z.a), mul_add(x.b, y.b, z.b)};
}
/// Returns z - x y.
template <class N>
inline Twice<N> mul_sub_from(const Twice<N>& x, const Twice<N>& y, const Twice<N>& z) {
  return {mul_sub_from(x.a, y.a, z.a), mul_sub_from(x.b, y.b, z.b)};
}
template <class M, class N>
inline Twice<N> select(const TwiceMask<M>& m, const Twice<N>& x, const Twice<N>& y) {
  return {select(m.a, x.a, y.a), select(m.b, x.b, y.b)};
}
template <class N>
inline Twice<N> round_nearest(const Twice<N>& x) {
  return {round_nearest(x.a), round_nearest(x.b)};
}
template <class N>
inline Twice<N> inverse_sqrt(const Twice<N>& x) {
  return {inverse_sqrt(x.a), inverse_sqrt(x.b)};
}

/// The number type P (kernels/tactile/tactile_point.hpp) with twice as many points at a time. The
/// bits are the same.
template <class P>
struct Paired {
  using Architecture = typename P::Architecture;
  using N = Twice<typename P::N>;
  using Real = typename P::Real;
  using Offset = PointOffset<N, false>;
  static constexpr bool kSingle = P::kSingle, kCurved = false;
  static constexpr int kComponents = P::kComponents;
  static constexpr int kLanes = 2 * P::kLanes;
  static constexpr double kSmallest = P::kSmallest;
  static N load(const Real* p) { return {P::load(p), P::load(p + P::kLanes)}; }
  static void store(const N& x, Real* p) {
    P::store(x.a, p);
    P::store(x.b, p + P::kLanes);
  }
  static const Real* offsets(const PadTiles& pad) { return P::offsets(pad); }
  static const Real* frames(const PadTiles& pad) { return P::frames(pad); }
  static const Real* factors(const PadTiles& pad) { return P::factors(pad); }
};

/// Paired where a vector is one register. Otherwise a pair would not fit into the registers.
template <class P, int Registers>
struct PairedIfOne {
  using Type = P;
};
template <class P>
struct PairedIfOne<P, 1> {
  using Type = Paired<P>;
};
template <class P>
using AcrossPoints = typename PairedIfOne<P, P::N::kRegisters>::Type;

}  // namespace tangere::kernels
