// SPDX-License-Identifier: Apache-2.0
// A model with everything that is needed to time single steps and readings of it from recorded
// states. Models of the same joints can be timed from the states of one run.
#pragma once

#include <span>
#include <vector>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/effects/recorded_states.hpp"

namespace tangere {

/// Sums over the steps of one sweep.
struct SweepTime {
  double seconds = 0;      ///< CPU time of this thread
  std::int64_t steps = 0;  ///< of single environments; failing ones included
  std::int64_t newton_passes = 0;
  std::int64_t failures = 0;  ///< steps that found no solution
};

class TimedModel {
 public:
  /// `recorded`: of a model that has the same joints, and every motor and number of this one. It
  /// must outlive this object.
  TimedModel(const Model& model, const RecordedStates& recorded, const StepperOptions& options);

  /// Takes one step of all environments from each instant, and times the steps alone.
  SweepTime time_steps();
  /// Reads one sensor in all environments at up to about `most_instants` of the instants, and times
  /// the readings alone. Its steps are readings.
  SweepTime time_readings(int sensor, int most_instants);

  [[nodiscard]] const Model& model() const { return batch_.model(); }

 private:
  [[nodiscard]] int instants() const { return static_cast<int>(starts_.size()); }
  void set_numbers();
  void restore(int instant);

  const RecordedStates& recorded_;
  Batch batch_;
  Stepper stepper_;
  Readout readout_;
  std::vector<std::vector<BlockState>> starts_;  // (instants, blocks)
  std::vector<std::vector<double>> controls_;    // (instants), (E, nu) each
  std::vector<double> field_;                    // of the environments of a block, (points, 3) each
};

}  // namespace tangere
