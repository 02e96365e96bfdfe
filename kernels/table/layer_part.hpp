// SPDX-License-Identifier: Apache-2.0
// The functions of an instruction set's table for layers that are contacts.
#pragma once

#include "kernels/layer/layer_points.hpp"
#include "kernels/layer/layer_system.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere::kernels {

template <class Arch>
void add_layer_kernels(KernelTable& k) {
  k.find_layer_points = find_layer_points<Arch>;
  k.add_layer_forces = add_layer_forces<Arch>;
  k.add_layer_slopes = add_layer_slopes<Arch>;
  k.factor_layer = factor_layer<Arch>;
  k.solve_layer = solve_layer<Arch>;
  k.couple_cells = couple_cells<Arch>;
  k.add_yield_slopes = add_yield_slopes<Arch>;
}

}  // namespace tangere::kernels
