// SPDX-License-Identifier: Apache-2.0
// One lane of Lanes<Arch> on its own. The number rounds like a lane in every operation, so a lone
// environment goes through the same templates with an eighth of the memory and gets the same bits.
#pragma once

#include "kernels/numbers/inverse_sqrt.hpp"

namespace tangere::kernels {

template <class Arch>
struct OneLane {
  double x;
  OneLane() = default;
  OneLane(double value)
      : x(value) {}  // NOLINT(google-explicit-constructor): constants read like numbers
};

#define TANGERE_ONE_LANE_BINARY(op)                           \
  template <class A>                                          \
  inline OneLane<A> operator op(OneLane<A> a, OneLane<A> b) { \
    return a.x op b.x;                                        \
  }                                                           \
  template <class A>                                          \
  inline OneLane<A> operator op(OneLane<A> a, double b) {     \
    return a.x op b;                                          \
  }                                                           \
  template <class A>                                          \
  inline OneLane<A> operator op(double a, OneLane<A> b) {     \
    return a op b.x;                                          \
  }
TANGERE_ONE_LANE_BINARY(+)
TANGERE_ONE_LANE_BINARY(-)
TANGERE_ONE_LANE_BINARY(*)
TANGERE_ONE_LANE_BINARY(/)
#undef TANGERE_ONE_LANE_BINARY

#define TANGERE_ONE_LANE_COMPARE(op)                    \
  template <class A>                                    \
  inline bool operator op(OneLane<A> a, OneLane<A> b) { \
    return a.x op b.x;                                  \
  }                                                     \
  template <class A>                                    \
  inline bool operator op(OneLane<A> a, double b) {     \
    return a.x op b;                                    \
  }
TANGERE_ONE_LANE_COMPARE(<)
TANGERE_ONE_LANE_COMPARE(<=)
TANGERE_ONE_LANE_COMPARE(>)
TANGERE_ONE_LANE_COMPARE(>=)
#undef TANGERE_ONE_LANE_COMPARE

template <class A>
inline OneLane<A> operator-(OneLane<A> a) {
  return -a.x;
}
template <class A>
inline OneLane<A>& operator+=(OneLane<A>& a, OneLane<A> b) {
  return a = a + b;
}
template <class A>
inline OneLane<A>& operator-=(OneLane<A>& a, OneLane<A> b) {
  return a = a - b;
}
inline unsigned lane_bits(bool m) { return m ? 1U : 0U; }
/// Fused exactly where Lanes<Arch> fuses.
template <class A>
inline OneLane<A> mul_add(OneLane<A> a, OneLane<A> b, OneLane<A> c) {
  if constexpr (kFuses<A>) return __builtin_fma(a.x, b.x, c.x);
  return a.x * b.x + c.x;
}
template <class A>
inline OneLane<A> mul_sub_from(OneLane<A> a, OneLane<A> b, OneLane<A> c) {
  if constexpr (kFuses<A>) return __builtin_fma(-a.x, b.x, c.x);
  return c.x - a.x * b.x;
}
template <class A>
inline OneLane<A> select(bool m, OneLane<A> a, OneLane<A> b) {
  return m ? a : b;
}
template <class A>
inline OneLane<A> sqrt(OneLane<A> a) {
  return std::sqrt(a.x);
}
template <class A>
inline OneLane<A> abs(OneLane<A> a) {
  return std::fabs(a.x);
}
/// Returns the larger; b where a is NaN.
template <class A>
inline OneLane<A> max(OneLane<A> a, OneLane<A> b) {
  return a.x > b.x ? a : b;
}
template <class A>
inline OneLane<A> min(OneLane<A> a, OneLane<A> b) {
  return a.x < b.x ? a : b;
}
template <class A>
inline OneLane<A> round_nearest(OneLane<A> a) {
  return round_nearest(a.x);
}
template <class A>
inline OneLane<A> inverse_sqrt(OneLane<A> a) {
  OneLane<A> y = detail::inverse_sqrt_seed(a.x);
  for (int step = 0; step < 2; ++step) y = detail::inverse_sqrt_step(a, y);
  return y;
}

}  // namespace tangere::kernels
