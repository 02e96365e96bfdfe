// SPDX-License-Identifier: Apache-2.0
// Skins that a URDF file has by the convention of urdf_tactile:
//   <sensor name="…"><parent link="…"/><origin …/><tactile><array …/> or <taxel …/>s</tactile>
#pragma once

#include <string>
#include <vector>

#include "io/robot/robot_node.hpp"

namespace tangere {

/// Whether a <sensor> is one of touch.
bool is_skin(const RobotNode& sensor);
/// Adds a <sensor> of touch to the skins of its robot. `links`: the names of the robot's links.
/// Fails at what is missing or names no link.
void read_skin(const RobotNode& sensor, const std::vector<std::string>& links);

}  // namespace tangere
