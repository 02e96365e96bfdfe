// SPDX-License-Identifier: Apache-2.0
// A robot's file in, a scene's text out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// A tactile skin on a link. `layout`: the text of a file with the root <sensor>, whose sensors are
/// attached to the link's body with a pose.
struct PadRequest {
  std::string link;         ///< or a site of MJCF
  std::string layout_name;  ///< for messages and comments
  std::string layout;
  /// Where the layout's frame lies in the link's, or in the site's. Its z points out of the skin.
  Pose pose;
  /// Instead: the middle of a face of the link's box, "+x", "-z" …; "" for none.
  std::string face;
};

/// A motor of a joint: force within the effort that the file gives, or a position motor.
struct MotorRequest {
  std::string joint;
  std::optional<double> P{};  ///< [N/m or N m/rad]; none: a force motor
  double D = 0;               ///< [N s/m or N m s/rad]
};

/// Links that may touch; `second` is "ground" for the ground.
struct TouchRequest {
  std::string first, second;
};

struct RobotOptions {
  bool allow_unknown = false;  ///< unknown elements and attributes become warnings
  bool free_base = false;      ///< the root link, or bodies of the world without joints, move
  std::vector<PadRequest> pads{};
  std::vector<MotorRequest> motors{};
  std::vector<TouchRequest> touches{};
  /// Links, or sites of MJCF, whose places a run stores.
  std::vector<std::string> end_effectors{};
  std::string keyframe;  ///< MJCF: the keyframe in which the scene starts; "": none
};

struct ImportedScene {
  std::string text;                                            ///< of the scene file
  std::string format;                                          ///< "URDF" or "MJCF"
  std::size_t links = 0, joints = 0, motors = 0, sensors = 0;  ///< joints: those that move
  std::size_t end_effectors = 0;
  std::vector<std::string> idle;     ///< left out, and of no effect on the motion
  std::vector<std::string> changed;  ///< expressed differently
  std::vector<std::string> lost;     ///< left out although it changes the motion
  std::vector<std::string> warnings;
};

/// Reads a URDF or MJCF file and returns it as a scene that will lie at `output`, which it names
/// meshes relative to. Nothing is written. Throws InputError ("file:line: …") for what is not of
/// the subset of docs/robots.md and not in its lists, IoError when a file cannot be read.
ImportedScene import_robot(const std::filesystem::path& path, const std::filesystem::path& output,
                           const RobotOptions& options = {});

}  // namespace tangere
