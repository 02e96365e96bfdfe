// SPDX-License-Identifier: Apache-2.0
// Two models of a scene from the same states: how the times of their steps and readings compare.
#pragma once

#include <cstdint>

#include "tasks/effects/timed_model.hpp"

namespace tangere {

/// What is timed of a pair of models.
struct TimedParts {
  bool steps = true;
  bool readings = false;
};

/// A difference of two times, as a share of the first model's step.
struct MeasuredShare {
  double share = 0;   ///< from medians over the rounds at every instant
  double spread = 0;  ///< standard deviation of the share when rounds are drawn anew
};

/// A model's own times, per environment.
struct StepTimes {
  double step = 0;     ///< [s]
  double reading = 0;  ///< all sensors, each in one of its `every` steps [s]
  double passes = 0;   ///< evaluations of the residual per step

  [[nodiscard]] double whole() const { return step + reading; }
};
StepTimes measure_times(TimedModel& model, int rounds);

struct ModelComparison {
  MeasuredShare saved{};
  double passes = 0;                     ///< of the other model, at the first model's tolerance
  std::int64_t steps = 0, failures = 0;  ///< of one sweep of the other model
};

/// Times `with` and `without` in turn. Both solve to `tolerance`, but the one that needs more
/// passes is given a looser one, with which it needs as many as the other: states of one model are
/// not in balance in the other, and the passes that this takes are not work of the effect.
ModelComparison compare(TimedModel& with, TimedModel& without, const StepTimes& times,
                        TimedParts parts, double tolerance, int rounds);

}  // namespace tangere
