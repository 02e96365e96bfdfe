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

/// One step of all environments from an instant.
struct TimedStep {
  double seconds = 0;  ///< of one environment: CPU time of this thread
  /// Evaluations of the residual: mean over the environments, and over groups of lanes, which
  /// iterate until their slowest lane converges.
  double passes = 0, group_passes = 0;
  int steps = 0, failures = 0;  ///< of environments; failures found no solution
};

class TimedModel {
 public:
  /// `recorded`: of a model that has the same joints, and every motor and number of this one. It
  /// must outlive this object.
  TimedModel(const Model& model, const RecordedStates& recorded, const StepperOptions& options);

  /// Sets the tolerance of the steps.
  void solve_to(double tolerance);
  /// Takes one step of all environments from an instant, and times the step alone.
  TimedStep time_step(int instant);
  /// Readings of the scene's <outputs>; without them, the field of every sensor.
  [[nodiscard]] std::span<const FieldOutput> readings() const { return outputs_; }
  /// Steps of a run for each taking of a reading, on average.
  [[nodiscard]] double interval(std::size_t reading) const;
  /// Takes a reading of the first block's environments, in double, and times that of one [s].
  double time_reading(std::size_t reading, int instant);

  [[nodiscard]] const Model& model() const { return batch_.model(); }
  /// Puts the batch into the states of an instant. Returns how many environments have not failed.
  int show(int instant);
  /// (E, nu) of the step that follows an instant.
  [[nodiscard]] std::span<const double> controls(int instant) const {
    return controls_[static_cast<std::size_t>(instant)];
  }
  [[nodiscard]] const StepperOptions& options() const { return options_; }
  [[nodiscard]] std::int64_t run_steps() const { return recorded_.steps; }
  /// The batch after the last step, reading or show().
  [[nodiscard]] const Batch& batch() const { return batch_; }

  [[nodiscard]] int instants() const { return static_cast<int>(starts_.size()); }

 private:
  void set_numbers();
  void restore(int instant);

  const RecordedStates& recorded_;
  StepperOptions options_;
  Batch batch_;
  Stepper stepper_;
  Readout readout_;
  std::vector<std::vector<BlockState>> starts_;  // (instants, blocks)
  std::vector<std::vector<double>> controls_;    // (instants), (E, nu) each
  std::vector<FieldOutput> outputs_;
  std::vector<std::vector<DenseFrame<double>>>
      frames_;                  // (readings), one per environment of a block; none for a sum
  std::vector<FieldSum> sums_;  // of a block's environments
};

}  // namespace tangere
