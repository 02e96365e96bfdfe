// SPDX-License-Identifier: Apache-2.0
// Directional derivative of a tactile field in dual numbers, for sensors without shear springs.
#pragma once

#include <span>

#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

/// Computes the outputs of DualStage::field(). `links`: poses and twists of all links.
/// `coefficients`: the sensor's.
void read_dual_field(const CompiledModel& m, int sensor,
                     std::span<const kernels::LinkScratch<kernels::Dual<double>>> links,
                     const Coefficients<kernels::Dual<double>>& coefficients, const double* column,
                     std::span<const double> numbers, std::span<const double> points,
                     std::span<double> field, std::span<double> field_dot);

}  // namespace tangere
