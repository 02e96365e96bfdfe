// SPDX-License-Identifier: Apache-2.0
// Angles of URDF are roll, pitch, yaw.
#include "io/robot/urdf_parts.hpp"

#include <fmt/format.h>

#include "io/robot/rotations.hpp"

namespace tangere {

std::optional<RobotNode> last_of(const std::vector<RobotNode>& parts, const std::string& name) {
  std::optional<RobotNode> found;
  for (const RobotNode& part : parts) {
    if (part.name() != name) continue;
    if (found)
      part.warn(
          fmt::format("given twice, first in line {}; the last counts (other readers take the "
                      "first, or refuse the file)",
                      found->source().line));
    found.emplace(part);
  }
  return found;
}

RobotNode required(const RobotNode& node, const std::vector<RobotNode>& parts,
                   const std::string& name) {
  const std::optional<RobotNode> found = last_of(parts, name);
  if (!found) node.fail("has no <" + name + ">");
  return *found;
}

Pose read_place(const RobotNode& node) {
  return {node.vector("xyz", Vector3{0, 0, 0}), from_rpy(node.vector("rpy", Vector3{0, 0, 0}))};
}

Pose read_origin(const std::optional<RobotNode>& node) {
  if (!node) return {};
  node->check({{"xyz"}, {"rpy"}});
  static_cast<void>(node->parts({}));
  return read_place(*node);
}

}  // namespace tangere
