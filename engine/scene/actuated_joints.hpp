// SPDX-License-Identifier: Apache-2.0
// The joints that motors move, of which a robot measures the coordinates. All others are of objects
// and of passive parts.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Names of joints, in file order: those with a motor; those that a motor moves through a
/// transmission, or by a joint that follows them; and those that follow such joints alone. A free
/// body that a wrench pushes is not among them.
std::vector<std::string> actuated_joints(const Scene& scene);

}  // namespace tangere
