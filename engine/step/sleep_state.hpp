// SPDX-License-Identifier: Apache-2.0
// Which bodies of an environment sleep (docs/sleeping.md), and what decides when they fall asleep
// and when they wake. A tree is a body with all that joints connect it with, the world left out.
#pragma once

#include <cstdint>
#include <vector>

namespace tangere {

/// Of one environment. Empty where no stepper with sleep has stepped it.
struct SleepState {
  std::vector<std::uint8_t> asleep;  ///< (trees) 1: sleeps
  std::vector<int> island;  ///< (trees) lowest of the trees that fell asleep with it; -1: awake
  std::vector<int> rested;  ///< (trees) steps in a row in which it hardly moved
  std::vector<double> u;    ///< (nu) controls of the last step before which something rested
  /// What awake bodies may move before one of them can come within reach of a sleeping one [m].
  double clearance = 0;
  int bodies = 0;          ///< that sleep now
  bool resting = false;    ///< some tree that is awake has rested in the last step
  std::int64_t slept = 0;  ///< steps that bodies slept since the episode began, summed over bodies

  /// Wakes every body and forgets how long bodies have rested.
  void wake() {
    const std::int64_t so_far = slept;
    *this = {};
    slept = so_far;
  }
};

}  // namespace tangere
