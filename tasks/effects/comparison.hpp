// SPDX-License-Identifier: Apache-2.0
// Two models of a scene from the same states: how the times of their steps and readings compare.
#pragma once

#include <cstdint>

#include "tasks/effects/timed_model.hpp"

namespace tangere {

/// The timed parts of a pair of models.
struct TimedParts {
  bool steps = true;
  bool readings = false;
  /// Newton passes of a stage of the steps that are compared. 1: what differs is evaluated once per
  /// pass. 2: the search for contacts or the linear system differ too.
  int passes = 1;
  /// What differs is done once per step, whatever its passes.
  bool once = false;
};

/// A difference of two times, as a share of the first model's step.
struct MeasuredShare {
  double share = 0;   ///< from lower quartiles over the rounds at every instant
  double spread = 0;  ///< standard deviation of the share by bootstrap over rounds
};

/// A model's own times, per environment.
struct StepTimes {
  double step = 0;     ///< [s]
  double reading = 0;  ///< all sensors, each in one of its `every` steps [s]
  double passes = 0;   ///< evaluations of the residual per step
  double stages = 1;   ///< evaluations of a step that accepts every first guess
  /// Time of a step that accepts every first guess, divided by `step`.
  double first_pass = 1;
  /// First-pass cost scaled by evaluations per step. Above 1, because a step predicts and searches
  /// once.
  double scaled_first_pass = 1;

  [[nodiscard]] double whole() const { return step + reading; }
};
StepTimes measure_times(TimedModel& model, double tolerance, int rounds);

struct ModelComparison {
  MeasuredShare saved{};
  double passes = 0;                     ///< of the other model, at the first model's tolerance
  std::int64_t steps = 0, failures = 0;  ///< of one sweep of the other model
};

/// Times `with` and `without` in turn, in steps of one or two Newton passes: the tolerance is
/// loosened until they need no more. Further passes compare nothing, because states of one model
/// are not in balance in the other: it goes another way, of more passes, and meets other contacts.
/// `tolerance`: the one of both otherwise.
ModelComparison compare(TimedModel& with, TimedModel& without, const StepTimes& times,
                        TimedParts parts, double tolerance, int rounds);

}  // namespace tangere
