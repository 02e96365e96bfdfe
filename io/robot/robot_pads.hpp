// SPDX-License-Identifier: Apache-2.0
// Tactile skins on links of a robot.
#pragma once

#include <string>
#include <vector>

#include "io/robot/robot.hpp"
#include "io/robot/robot_import.hpp"

namespace tangere {

/// The skins of the robot's file and the sensors of all pads as text for <sensor>; "" if there are
/// none. `file` names the robot for messages. Throws InputError for a link that is not there, a
/// face of what is no box, and a layout that is no list of sensors in metres.
std::string pads_text(const Robot& robot, const std::vector<PadRequest>& pads,
                      const std::string& file);

}  // namespace tangere
