// SPDX-License-Identifier: Apache-2.0
// Gaps and forces of loops in a state.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

class Batch;

/// A loop in a state. Forces are what the springs and dampers exert.
struct LoopReading {
  double gap = 0;     ///< distance of its two points [m]
  double turn = 0;    ///< of a weld: the angle between its two frames [rad]
  double force = 0;   ///< [N]
  double torque = 0;  ///< of a weld [N m]
};

/// Returns the loops of one environment, in the order of Scene::loops. Throws InputError for an
/// environment that is not there.
std::vector<LoopReading> loop_readings(const Model& model, const Batch& batch, int environment);

/// Returns a line for each loop that starts open by more than 1 mm or 0.01 rad, at the starting
/// state of the scene's first environment with seed 0: the first step closes it at once.
std::vector<std::string> open_loops(const Model& model);

}  // namespace tangere
