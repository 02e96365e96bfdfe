// SPDX-License-Identifier: Apache-2.0
// Text and checks of a sensor's imperfections; the schema lists them.
#pragma once

#include <string>

#include "engine/scene/sensor_imperfections.hpp"

namespace tangere {

/// Whether any coefficient is not 0.
bool is_imperfect(const SensorImperfections& imperfections);
/// Whether a reading depends on earlier states.
bool has_lag(const SensorImperfections& imperfections);
/// Returns "noise 0.002 0.001 N, dead 0.01": nonzero coefficients, normal before shear if they
/// differ.
std::string text_of(const SensorImperfections& imperfections);
/// Throws InputError (file:line) for a value that is negative, not finite or too large. `sensor`:
/// its name. `grid`: whether its points have neighbours.
void check_imperfections(const SensorImperfections& imperfections, const std::string& sensor,
                         bool grid);

}  // namespace tangere
