// SPDX-License-Identifier: Apache-2.0
// The factorisation in blocks of an instruction set's table.
#pragma once

#include "kernels/step/block_lu.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere::kernels {

template <class Arch>
void add_block_kernels(KernelTable& k) {
  k.factor_blocks = factor_blocks<Arch>;
  k.solve_blocks = solve_blocks<false, Arch>;
  k.solve_blocks_watched = solve_blocks_watched<false, Arch>;
  k.solve_blocks_transposed = solve_blocks_watched<true, Arch>;
}

}  // namespace tangere::kernels
