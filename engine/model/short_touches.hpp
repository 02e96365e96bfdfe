// SPDX-License-Identifier: Apache-2.0
// Contacts that give back what they hold, in steps that are too long to see them do it.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Returns a line for each contact whose damping takes less than 1e-4 of the speed of a body
/// that falls through half of the scene's extent, and whose touches are too short for steps of
/// length h [s] by a scheme. How fast bodies leave is then a matter of the step. A touch lasts π
/// √(m/kn) where one point touches, m the reduced mass of both bodies, and less where more do.
std::vector<std::string> short_touches(const Model& model, Integrator integrator, double h);

}  // namespace tangere
