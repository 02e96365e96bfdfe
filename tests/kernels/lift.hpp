// SPDX-License-Identifier: Apache-2.0
// Numbers with a tangent where the number type has one: lift<Dual<double>>(x, ẋ) and
// lift<double>(x, ẋ).
#pragma once

#include <type_traits>

#include "kernels/numbers/linalg.hpp"

namespace tangere::testing {

template <class N>
N lift(double x, double tangent) {
  if constexpr (std::is_same_v<N, double>)
    return x;
  else
    return N(x, tangent);
}
template <class N>
kernels::Vec3<N> lift(const kernels::Vec3<double>& x, const kernels::Vec3<double>& tangent) {
  return {lift<N>(x.x, tangent.x), lift<N>(x.y, tangent.y), lift<N>(x.z, tangent.z)};
}

}  // namespace tangere::testing
