// SPDX-License-Identifier: Apache-2.0
// Gain of sleep over a whole run. Single steps from recorded states cannot show it, because bodies
// fall asleep along a run.
#pragma once

#include <cstddef>
#include <cstdint>

#include "tasks/effects/comparison.hpp"

namespace tangere {

struct SleepGain {
  /// What sleep adds to a step of one environment, as a share of a step without it; negative: it
  /// saves that. Medians over the rounds; the standard deviation is that of their mean.
  MeasuredShare added{};
  double mean_asleep = 0;  ///< bodies that sleep, on average over steps and environments
  std::size_t bytes = 0;   ///< size of the sleep state of one environment
};

/// Plays the scene's own controls with sleep and without it, in turn, for as many steps as
/// record_states() does, on one thread's CPU time. The scene must enable sleep.
SleepGain measure_sleep_gain(const Model& model, int environments, std::uint64_t seed, int rounds);

}  // namespace tangere
