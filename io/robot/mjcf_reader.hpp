// SPDX-License-Identifier: Apache-2.0
// Reads the subset of MJCF, MuJoCo's model files, that docs/robots.md lists.
#pragma once

#include "io/robot/robot_node.hpp"

namespace tangere {

/// Reads the root <mujoco>. `keyframe` names the keyframe in which the scene starts, "" for none.
/// With `free_base`, bodies of the world without joints move freely. Throws InputError ("file:line:
/// …") for what is outside the subset and cannot be left out.
void read_mjcf(const RobotNode& root, const std::string& keyframe, bool free_base);

}  // namespace tangere
