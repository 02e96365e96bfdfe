// SPDX-License-Identifier: Apache-2.0
// Sleep state of one environment: sleeping trees, rest counters and reach (docs/sleeping.md). A
// tree is a body with all bodies that joints connect it with, the world excluded.
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

  /// Wakes every body and resets the rest counters.
  void wake() {
    const std::int64_t so_far = slept;
    *this = {};
    slept = so_far;
  }
};

}  // namespace tangere
