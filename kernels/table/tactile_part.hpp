// SPDX-License-Identifier: Apache-2.0
// The tactile functions of an instruction set's table.
#pragma once

#include <type_traits>

#include "kernels/table/parts.hpp"
#include "kernels/tactile/tactile_block.hpp"

namespace tangere::kernels {

template <class Arch, class Real>
using PointNumbers =
    std::conditional_t<std::is_same_v<Real, double>, InDouble<Arch>, InMixed<Arch>>;

template <class Arch, class Real>
int TactilePart<Arch, Real>::tactile(const TactileArgs<Real>& a) {
  return any_field<PointNumbers<Arch, Real>>(a);
}

template <class Arch, class Real>
void TactilePart<Arch, Real>::tactile_block(const TactileBlockArgs<Real>& a) {
  any_block<PointNumbers<Arch, Real>>(a);
}

}  // namespace tangere::kernels
