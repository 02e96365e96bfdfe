// SPDX-License-Identifier: Apache-2.0
// Forward-mode dual numbers, value + ε part. They are the second of three routes by which every
// derivative is checked.
//   f(a + ε a') = f(a) + ε f'(a) a'. Comparisons and select() use the value alone.
#pragma once

#include "kernels/numbers/inverse_sqrt.hpp"

namespace tangere::kernels {

template <class N>
struct Dual {
  N value;
  N epsilon;
  Dual() = default;
  Dual(double x) : value(x), epsilon(0.0) {}  // NOLINT(google-explicit-constructor)
  Dual(const N& x, const N& e) : value(x), epsilon(e) {}
};

template <class N>
Dual<N> operator+(const Dual<N>& a, const Dual<N>& b) {
  return {a.value + b.value, a.epsilon + b.epsilon};
}
template <class N>
Dual<N> operator-(const Dual<N>& a, const Dual<N>& b) {
  return {a.value - b.value, a.epsilon - b.epsilon};
}
template <class N>
Dual<N> operator-(const Dual<N>& a) {
  return {-a.value, -a.epsilon};
}
template <class N>
Dual<N> operator*(const Dual<N>& a, const Dual<N>& b) {
  return {a.value * b.value, mul_add(a.epsilon, b.value, a.value * b.epsilon)};
}
template <class N>
Dual<N> operator/(const Dual<N>& a, const Dual<N>& b) {
  const N q = a.value / b.value;
  return {q, mul_sub_from(q, b.epsilon, a.epsilon) / b.value};
}

#define TANGERE_DUAL_MIXED(op)                      \
  template <class N>                                \
  Dual<N> operator op(const Dual<N>& a, double b) { \
    return a op Dual<N>(b);                         \
  }                                                 \
  template <class N>                                \
  Dual<N> operator op(double a, const Dual<N>& b) { \
    return Dual<N>(a) op b;                         \
  }
TANGERE_DUAL_MIXED(+)
TANGERE_DUAL_MIXED(-)
TANGERE_DUAL_MIXED(*)
TANGERE_DUAL_MIXED(/)
#undef TANGERE_DUAL_MIXED

#define TANGERE_DUAL_COMPARE(op)                         \
  template <class N>                                     \
  auto operator op(const Dual<N>& a, const Dual<N>& b) { \
    return a.value op b.value;                           \
  }                                                      \
  template <class N>                                     \
  auto operator op(const Dual<N>& a, double b) {         \
    return a.value op b;                                 \
  }
TANGERE_DUAL_COMPARE(<)
TANGERE_DUAL_COMPARE(<=)
TANGERE_DUAL_COMPARE(>)
TANGERE_DUAL_COMPARE(>=)
#undef TANGERE_DUAL_COMPARE

template <class N>
Dual<N>& operator+=(Dual<N>& a, const Dual<N>& b) {
  return a = a + b;
}
template <class N>
Dual<N>& operator-=(Dual<N>& a, const Dual<N>& b) {
  return a = a - b;
}
template <class N>
Dual<N> mul_add(const Dual<N>& a, const Dual<N>& b, const Dual<N>& c) {
  return {mul_add(a.value, b.value, c.value),
          mul_add(a.epsilon, b.value, mul_add(a.value, b.epsilon, c.epsilon))};
}
template <class N>
Dual<N> mul_sub_from(const Dual<N>& a, const Dual<N>& b, const Dual<N>& c) {
  return c - a * b;
}
template <class M, class N>
Dual<N> select(const M& m, const Dual<N>& a, const Dual<N>& b) {
  return {select(m, a.value, b.value), select(m, a.epsilon, b.epsilon)};
}
template <class N>
Dual<N> sqrt(const Dual<N>& a) {
  const N r = sqrt(a.value);
  return {r, a.epsilon / (r * 2.0)};
}
template <class N>
Dual<N> inverse_sqrt(const Dual<N>& a) {
  const N y = inverse_sqrt(a.value);
  return {y, (N(-0.5) * y) * (y * y) * a.epsilon};
}
template <class N>
Dual<N> abs(const Dual<N>& a) {
  return {abs(a.value), select(a.value < N(0.0), -a.epsilon, a.epsilon)};
}
template <class N>
Dual<N> round_nearest(const Dual<N>& a) {
  return {round_nearest(a.value), N(0.0)};
}
template <class N>
Dual<N> max(const Dual<N>& a, const Dual<N>& b) {
  return select(a.value > b.value, a, b);
}
template <class N>
Dual<N> min(const Dual<N>& a, const Dual<N>& b) {
  return select(a.value < b.value, a, b);
}

}  // namespace tangere::kernels
