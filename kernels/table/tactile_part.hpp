// SPDX-License-Identifier: Apache-2.0
// The tactile functions of an instruction set's table.
#pragma once

#include <type_traits>

#include "kernels/table/kernel_table.hpp"
#include "kernels/tactile/tactile_block.hpp"

namespace tangere::kernels {

template <class Arch, class Real>
using PointNumbers =
    std::conditional_t<std::is_same_v<Real, double>, InDouble<Arch>, InMixed<Arch>>;

template <class Arch, class Real>
void add_tactile_kernels(KernelTable& k) {
  using Numbers = PointNumbers<Arch, Real>;
  const auto one = [](const TactileArgs<Real>& a) { return any_field<Numbers>(a); };
  const auto block = [](const TactileBlockArgs<Real>& a) { any_block<Numbers>(a); };
  if constexpr (std::is_same_v<Real, double>)
    k.tactile = one, k.tactile_block = block;
  else
    k.tactile_mixed = one, k.tactile_block_mixed = block;
}

}  // namespace tangere::kernels
