// SPDX-License-Identifier: Apache-2.0
// Finds and reads the surface files that robots name.
#pragma once

#include "io/robot/robot_node.hpp"

namespace tangere {

/// A surface file that a robot file names.
struct RobotMesh {
  MeshFile file;
  MeshShape shape;  ///< what the scene has: the file's surface, or its hull if that is open
  MeshShape faces;  ///< what the file has: closed or open
};

/// Finds, reads and scales the file `name`: relative to `folder`, absolute, file://, or
/// package://NAME/…, where NAME is searched as a folder above the robot's file. Returns no value,
/// and lists it, if scenes cannot have such a shape. Fails at the node if the file is missing or
/// damaged. `other_folder`, beside the robot's file, is searched last: with the folders of the
/// name, then without.
std::optional<RobotMesh> read_robot_mesh(const RobotNode& node, const std::string& name,
                                         const std::string& folder, const Vector3& scale,
                                         const std::optional<std::string>& other_folder = {});

/// The same for a mesh of MJCF without a file: its `vertex` and `face`, or `vertex` alone for the
/// convex hull.
std::optional<RobotMesh> read_written_mesh(const RobotNode& node, const Vector3& scale);

}  // namespace tangere
