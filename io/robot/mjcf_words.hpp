// SPDX-License-Identifier: Apache-2.0
// What is known of the elements of MJCF that may have defaults: a default has the attributes of the
// element that it is for.
#pragma once

#include <string>

#include "io/robot/robot_node.hpp"

namespace tangere {

// Reasons that several tables give.
inline constexpr const char* kSight = "for pictures only";
inline constexpr const char* kSolverSetting = "a setting of MuJoCo's solver";

/// The attributes of <joint>, <geom>, <site>, <mesh>, <material>, <general>, <motor>, <position> or
/// <velocity>.
const Words& mjcf_words(const std::string& element);

/// The rotations of bodies, geoms, frames and inertials.
Words with_rotations(Words words);

}  // namespace tangere
