// SPDX-License-Identifier: Apache-2.0
// Polynomials of degree four at most, with two derivatives, by Horner's scheme.
#pragma once

#include <array>
#include <cstddef>

namespace tangere::kernels {

/// Coefficients of q⁰ … q⁴.
using Polynomial = std::array<double, 5>;

template <class N>
struct PolynomialValue {
  N value, slope, second;  ///< p, p', p''
};

template <class N>
PolynomialValue<N> polynomial_at(const Polynomial& c, const N& q) {
  PolynomialValue<N> p = {N(c.back()), N(0.0), N(0.0)};
  for (std::size_t k = c.size() - 1; k-- > 0;) {
    p.second = p.second * q + N(2.0) * p.slope;
    p.slope = p.slope * q + p.value;
    p.value = p.value * q + N(c[k]);
  }
  return p;
}

}  // namespace tangere::kernels
