// SPDX-License-Identifier: Apache-2.0
// Finds nearly undamped contacts whose duration is below what the step length resolves.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Returns a line for each contact whose damping reduces the speed of a body that falls through
/// half of the scene's extent by less than 1e-4, and whose impacts are too short for steps of
/// length h [s] by this scheme: rebound speeds then depend on h. An impact lasts π √(m/kn) if one
/// point touches (m: reduced mass of both bodies), less if several do.
std::vector<std::string> short_touches(const Model& model, Integrator integrator, double h);

}  // namespace tangere
