// SPDX-License-Identifier: Apache-2.0
// A file inside a MJCF file.
#pragma once

#include "io/robot/robot_node.hpp"

namespace tangere {

/// A file that an <include> has brought in. Its elements refer to both.
struct RobotFile {
  tinyxml2::XMLDocument document;
  SceneContext context;
};

/// Reads the file that an <include> names and returns its root. The robot keeps it. Throws
/// InputError for a file that is there twice, and what reading and parsing a file throws, each with
/// the line of the <include>.
RobotNode included_root(const RobotNode& include);

}  // namespace tangere
