// SPDX-License-Identifier: Apache-2.0
// Names of what falls asleep together, for files that hold who sleeps.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Returns the name of the first body of each kinematic tree, in the order of SleepState.
std::vector<std::string> sleeping_trees(const Model& model);

}  // namespace tangere
