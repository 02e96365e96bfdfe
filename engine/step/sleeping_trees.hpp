// SPDX-License-Identifier: Apache-2.0
// Names of kinematic trees, for files that store the sleep state.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Returns the name of the first body of each kinematic tree, in the order of SleepState.
std::vector<std::string> sleeping_trees(const Model& model);

}  // namespace tangere
