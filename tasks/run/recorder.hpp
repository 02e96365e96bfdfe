// SPDX-License-Identifier: Apache-2.0
// The channels of a rollout: what describes each of them, when it has a row, and what computes it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/rows/channel.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/energy_balance_recorder.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/rollout_options.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// Bound to one batch. Rows are computed when they are due, into buffers that begin() makes.
class Recorder {
 public:
  enum class When {
    step,    ///< after a step, before counts and the task's snapshot
    action,  ///< after the end of a task's action
    row      ///< after all of that, and before the first step
  };

  /// `task`: of the actions that are recorded; null for a scene. The arguments must outlive this
  /// object, and there must be a stepper.
  Recorder(const Batch& batch, std::span<const Stepper> steppers, const RolloutOptions& options,
           const TaskSpec* task);
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Returns the description of all that is recorded, without facts of the run.
  [[nodiscard]] Recording take_description() { return std::move(recording_); }

  /// Begins to hand rows on. `u`: (E, nu) controls of each step; `tally` counts them; `data`: of
  /// the task. All must outlive this object.
  void begin(std::span<const double> u, const StepTally& tally, const EnvironmentData* data,
             BlockThreads& threads, RowSink& sink);
  /// Notes what the batch is before a step.
  void before_step();
  /// Notes how step `t` - 1 went, which was taken but not counted yet, and writes its channels.
  void after_step(std::int64_t t);
  /// Writes the channels that are due after `t` steps.
  void write(When when, std::int64_t t);

  [[nodiscard]] std::optional<EnergyBalanceSummary> audit() const;
  /// As Readout::loads_not_carried(), of all that was recorded.
  [[nodiscard]] std::int64_t loads_not_carried() const;

 private:
  using Read = std::function<Numbers(std::int64_t t, int part)>;
  struct Source {
    When when;
    OutputTimes times;
    bool at_start;  ///< also before the first step
    int parts;      ///< of a row
    Read read;
  };

  [[nodiscard]] std::int64_t rows(const OutputTimes& times, bool at_start) const;
  [[nodiscard]] bool due(const Source& source, std::int64_t t) const;
  void add(Channel channel, Source source);
  void add_steps(const std::string& name, const char* meaning, const Source& of);
  void add_state();
  void add_sleep();
  void add_shear(const OutputTimes& times);
  void add_motion();
  void add_solver();
  void add_audit();
  void add_transmissions();
  void add_readings();
  void add_views();
  void add_randomized();
  void add_task();
  void resize_buffers();
  void read_shear(int block);
  template <class T>
  std::span<const T> read_as(FieldOutput output, std::vector<T>& buffer);
  [[nodiscard]] std::span<double> part(std::span<double> all, int environment) const;

  const Batch& batch_;
  const Model& model_;
  std::span<const Stepper> steppers_;
  const RolloutOptions& options_;
  const TaskSpec* task_;
  std::uint64_t environments_;
  Recording recording_;
  std::vector<Source> sources_;  // parallel to the channels

  std::span<const double> u_;
  const StepTally* tally_ = nullptr;
  const EnvironmentData* data_ = nullptr;
  BlockThreads* threads_ = nullptr;
  RowSink* sink_ = nullptr;
  std::vector<Readout> readouts_;  // one for each thread
  std::optional<EnergyBalanceRecorder> audit_;
  ShearStateArrays shear_points_;
  std::size_t bodies_ = 0;  // recorded
  std::int64_t row_ = 0;
  double time_ = 0;
  std::vector<double> q_, v_, pose_, twist_, end_effectors_, forces_;  // (E, …)
  std::vector<double> reading_;                                        // shared by the sensors
  std::vector<float> heights_;                                         // of pictures
  std::vector<std::uint8_t> bytes_;                                    // of pictures in colours
  std::vector<std::int16_t> ids_;                                      // of bodies in pictures
  std::vector<double> shear_;                                          // (16, points, 3)
  std::vector<double> sleep_u_, clearance_;                            // (E, nu), (E)
  std::vector<std::int32_t> iterations_, island_, rested_;             // (E), (E, trees)
  std::vector<std::int8_t> status_, resting_;                          // (E)
};

}  // namespace tangere
