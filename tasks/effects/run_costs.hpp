// SPDX-License-Identifier: Apache-2.0
// Cost per step of optional outputs of a run: rows of states, energy balance, derivatives. Readings
// of sensors are effects of the scene (effect_costs.hpp).
#pragma once

#include <string>
#include <vector>

#include "tasks/effects/comparison.hpp"

namespace tangere {

/// One thing that is added. It is no part of a step's time.
struct RunCost {
  std::string name;          ///< "audit"
  std::string requested_by;  ///< the option or line, in words
  bool on = false;           ///< whether simulate computes it by the scene's <outputs> or default
  double seconds = 0;        ///< for one environment and step [s]
  double share = 0;          ///< the same over a step with its readings
  std::int64_t bytes = 0;    ///< that it stores for one environment and step
};

/// Times each after single steps of the first block from the recorded instants, on one thread's CPU
/// time; of `rounds` at an instant the lower quartile counts. Empty where every environment fails.
std::vector<RunCost> measure_run_costs(TimedModel& model, const StepTimes& times, int rounds);

}  // namespace tangere
