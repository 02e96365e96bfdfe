// SPDX-License-Identifier: Apache-2.0
// Finds and reads the surface files that robots name.
#pragma once

#include "io/robot/robot_node.hpp"

namespace tangere {

/// Where the file is that a robot file names: relative to `folder`, absolute, file://, or
/// package://NAME/…, whose NAME is looked for as a folder above the robot's file. Fails at the
/// node, naming the places that were tried.
std::string find_mesh(const RobotNode& node, const std::string& name, const std::string& folder);

/// Reads the surface and scales it. Errors name the node and the file.
MeshShape read_robot_mesh(const RobotNode& node, const MeshFile& file);

}  // namespace tangere
