// SPDX-License-Identifier: Apache-2.0
// Spreads a field on a grid over the neighbours of its points (engine/model/lateral_spread.hpp).
#pragma once

#include <array>
#include <span>

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// y_i = Σ_j S_ij x_j along rows, then along columns; `back`: the transpose. `field`: (rows, cols,
/// components). `scratch` has its size at least. An empty kernel changes nothing along its axis.
void spread_field(const std::array<LateralSpread, 2>& spread, int rows, int cols, int components,
                  bool back, std::span<double> field, std::span<double> scratch);

}  // namespace tangere
