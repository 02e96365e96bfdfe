// SPDX-License-Identifier: Apache-2.0
// Directional derivative of the field of a sensor with a layer, in dual numbers.
#pragma once

#include "engine/derivative/dual_field.hpp"
#include "engine/sense/layered_field.hpp"

namespace tangere {

/// Computes the outputs of DualStage::field() from the springs' fields and how they change.
void read_dual_layer(const CompiledModel& m, int sensor,
                     std::span<const kernels::LinkScratch<kernels::Dual<double>>> links,
                     const Coefficients<kernels::Dual<double>>& coefficients, const double* column,
                     std::span<const double> numbers, const SpringFields& springs,
                     const SpringFields& springs_dot, std::span<double> field,
                     std::span<double> field_dot);

}  // namespace tangere
