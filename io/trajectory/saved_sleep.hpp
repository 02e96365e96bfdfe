// SPDX-License-Identifier: Apache-2.0
// The sleep state at one row of a trajectory file.
#pragma once

#include <string>
#include <vector>

#include "engine/step/sleep_state.hpp"

namespace tangere {

struct SavedSleep {
  std::vector<std::string> trees;        ///< names of their first bodies
  std::vector<SleepState> environments;  ///< (E)
};

}  // namespace tangere
