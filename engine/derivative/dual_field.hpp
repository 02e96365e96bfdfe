// SPDX-License-Identifier: Apache-2.0
// How a tactile field changes along a direction, in dual numbers, for skins whose friction does not
// remember.
#pragma once

#include <span>

#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

/// Computes what DualStage::field() says. `links`: poses and twists of all links.
/// `coefficients`: the sensor's.
void read_dual_field(const CompiledModel& m, int sensor,
                     std::span<const kernels::LinkScratch<kernels::Dual<double>>> links,
                     const Coefficients<kernels::Dual<double>>& coefficients, const double* column,
                     std::span<const double> numbers, std::span<const double> points,
                     std::span<double> field, std::span<double> field_dot);

}  // namespace tangere
