// SPDX-License-Identifier: Apache-2.0
// Compiles the gel markers of a sensor: compliance, bulge and lateral spread.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// The markers of a sensor; engine/sense/marker_map.hpp has the equation.
struct CompiledMarkers {
  int rows = 0, cols = 0;  ///< of a grid; a list of points has one row
  int pressure_sign = 1;
  double compliance = 0;                  ///< 1/k_s [m/N]
  double bulge = 0;                       ///< t/(2 k_s) [m²/N]; 0: none
  std::array<double, 2> pitch{};          ///< [m], signed
  std::array<LateralSpread, 2> spread{};  ///< empty kernels: none
};

/// Returns nothing for a sensor with a layer, whose surface moves them. Throws InputError
/// (file:line) for numbers that are out of range, where the shear stiffness is
/// not known, and for what needs neighbours on a list of points.
CompiledMarkers compile_markers(const TactileDescription& description, int pressure_sign);

}  // namespace tangere
