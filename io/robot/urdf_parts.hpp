// SPDX-License-Identifier: Apache-2.0
// Parts of elements of URDF.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "engine/scene/pose.hpp"
#include "io/robot/robot_node.hpp"

namespace tangere {

/// The child of this name, the last if there are several, with a warning; none if it is missing.
std::optional<RobotNode> last_of(const std::vector<RobotNode>& parts, const std::string& name);
/// The same. Fails at `node` if it is missing.
RobotNode required(const RobotNode& node, const std::vector<RobotNode>& parts,
                   const std::string& name);
/// The pose that xyz and rpy of an element give.
Pose read_place(const RobotNode& node);
/// That of an <origin>; none: at the origin.
Pose read_origin(const std::optional<RobotNode>& node);

}  // namespace tangere
