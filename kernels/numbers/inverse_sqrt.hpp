// SPDX-License-Identifier: Apache-2.0
// 1/√a from an integer seed and two steps of order four. The bits are the same on every machine. It
// takes a fifth of the cycles of the square root and the division that it replaces.
//
//   y₀ = bits(0x5fe6eb50c7b537a9 - bits(a) / 2), |a y₀² - 1| < 0.07;   e = 1 - a y²,
//       y ← y + y e (1/2 + 3/8 e + 5/16 e²)
// After two steps e is at rounding: the relative error is below 4e-16. For a = 0 the result is
// large and finite, so that a · inverse_sqrt(a) is 0, not NaN.
#pragma once

#include <cstdint>

#include "kernels/numbers/lanes.hpp"

namespace tangere::kernels {

namespace detail {
inline double inverse_sqrt_seed(double a) {
  return __builtin_bit_cast(double,
                            0x5fe6eb50c7b537a9ULL - (__builtin_bit_cast(std::uint64_t, a) >> 1));
}
template <class A>
xsimd::batch<double, A> inverse_sqrt_seed(const xsimd::batch<double, A>& a) {
  using Integers = xsimd::batch<std::uint64_t, A>;
  const Integers half = xsimd::bitwise_cast<Integers>(a) >> 1;
  return xsimd::bitwise_cast<xsimd::batch<double, A>>(Integers(0x5fe6eb50c7b537a9ULL) - half);
}
template <class N>
N inverse_sqrt_step(const N& a, const N& y) {
  const N e = mul_sub_from(a * y, y, N(1.0));
  const N slope = mul_add(mul_add(N(0.3125), e, N(0.375)), e, N(0.5));
  return mul_add(y * e, slope, y);
}
}  // namespace detail

/// Returns 1/√a for a ≥ 0.
template <class A>
inline Lanes<A> inverse_sqrt(const Lanes<A>& a) {
  Lanes<A> y;
  for (int i = 0; i < Lanes<A>::kRegisters; ++i) y.r[i] = detail::inverse_sqrt_seed(a.r[i]);
  for (int step = 0; step < 2; ++step) y = detail::inverse_sqrt_step(a, y);
  return y;
}
inline double inverse_sqrt(double a) { return a > 0 ? 1 / std::sqrt(a) : 1e100; }

/// Returns √a from its inverse root with one correction: within an ulp where products are fused.
/// Returns 0 for a = 0.
template <class N>
N root_of(const N& a, const N& inverse) {
  const N root = a * inverse;
  return mul_add(mul_sub_from(root, root, a), N(0.5) * inverse, root);
}

}  // namespace tangere::kernels
