// SPDX-License-Identifier: Apache-2.0
// Writes an imported robot as a readable scene file: one element a line, in SI, each with a comment
// that names its origin.
#pragma once

#include <string>
#include <vector>

#include "io/robot/robot.hpp"

namespace tangere {

/// What a scene has beside the robot, as text of its own: elements of one section, indented.
struct SceneSections {
  std::string head;      ///< the comment at the top, without its marks
  std::string defaults;  ///< inside <default>; "" for none
  std::string contacts;  ///< inside <contact>; "" for none
  std::string sensors;   ///< inside <sensor>; "" for none
  std::string places;    ///< inside <variable>; "" for none
};

/// Returns the text of the scene. `folder`: where it will lie; meshes are named relative to it.
std::string write_scene(const Robot& robot, const SceneSections& sections,
                        const std::string& folder);

/// A number such that reading it gives the same bits.
std::string number_text(double x);
/// ` pos="…" quat="…"`, without what is zero.
std::string pose_text(const Pose& pose);
/// Text between quotes, or in a comment.
std::string attribute_text(const std::string& text);
std::string comment_text(const std::string& text);

}  // namespace tangere
