// SPDX-License-Identifier: Apache-2.0
// Reads URDF, the robot description of ROS: a list of links and a list of joints between them.
#pragma once

#include "io/robot/robot_node.hpp"

namespace tangere {

/// Reads the root <robot>. `free_base`: the root link moves freely instead of standing in the
/// world. Throws InputError ("file:line: …") for what is no robot.
void read_urdf(const RobotNode& root, bool free_base);

}  // namespace tangere
