// SPDX-License-Identifier: Apache-2.0
// The bounds of controls, to which motors clip them.
#pragma once

#include <array>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns the least and largest value of each control, in the order of controls: [-1, 1] of force
/// motors without scale, else u_range. Beyond them a control has the effect of the bound.
std::vector<std::array<double, 2>> control_bounds(const Scene& scene);

}  // namespace tangere
