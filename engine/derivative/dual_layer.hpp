// SPDX-License-Identifier: Apache-2.0
// Directional derivative of the field of a sensor with a layer, in dual numbers.
#pragma once

#include <functional>

#include "engine/derivative/dual_field.hpp"
#include "engine/sense/layered_field.hpp"

namespace tangere {

/// Computes the field of springs with a law and how it changes, (points, 3) each.
using DualSprings = std::function<void(const Coefficients<kernels::Dual<double>>& law, bool elastic,
                                       std::span<double> field, std::span<double> field_dot)>;

/// Computes the outputs of DualStage::field(). `loads`: those that a layer under load control
/// carries.
void read_dual_layer(const CompiledModel& m, int sensor,
                     std::span<const kernels::LinkScratch<kernels::Dual<double>>> links,
                     const Coefficients<kernels::Dual<double>>& coefficients,
                     const LayerMaterial& material_dot, const double* column,
                     std::span<const double> numbers, const DualSprings& springs,
                     const std::array<kernels::Dual<double>, 3>& loads, std::span<double> field,
                     std::span<double> field_dot);

}  // namespace tangere
