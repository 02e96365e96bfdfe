// SPDX-License-Identifier: Apache-2.0
// The tactile functions of an instruction set's table.
#pragma once

#include "kernels/table/parts.hpp"
#include "kernels/tactile/tactile_block.hpp"

namespace tangere::kernels {

template <class Arch>
int TactilePart<Arch>::tactile(const TactileArgs<double>& a) {
  return any_field<InDouble<Arch>>(a);
}

template <class Arch>
int TactilePart<Arch>::tactile_mixed(const TactileArgs<float>& a) {
  return any_field<InMixed<Arch>>(a);
}

template <class Arch>
void TactilePart<Arch>::tactile_block(const TactileBlockArgs<double>& a) {
  any_block<InDouble<Arch>>(a);
}

template <class Arch>
void TactilePart<Arch>::tactile_block_mixed(const TactileBlockArgs<float>& a) {
  any_block<InMixed<Arch>>(a);
}

}  // namespace tangere::kernels
