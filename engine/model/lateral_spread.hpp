// SPDX-License-Identifier: Apache-2.0
// Lateral spread of forces in a skin over the points of a grid, with weights along both axes
//   S_ij = K(|i - j|) / Σ_i K(|i - j|),   K(k) = exp(-k² pitch² / (2 spread²)),
// so Σ_i S_ij = 1: the sum of forces is conserved, at edges too.
#pragma once

#include <string>

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Whether the points of a sensor are those of its array, also where they have been moved since.
bool has_grid(const TactileDescription& description);
/// Returns the distances between the points of an array along axis0 and axis1 [m]; negative where
/// its corners run against an axis, 0 for a single row.
std::array<double, 2> pitches(const RectArray& array);
/// Returns the weights from row to row and from column to column. `spread` [m]. Throws InputError,
/// which begins with `where`, if it reaches too many points.
std::array<LateralSpread, 2> lateral_spread(const RectArray& array, double spread,
                                            const std::string& where);

}  // namespace tangere
