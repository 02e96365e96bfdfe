// SPDX-License-Identifier: Apache-2.0
// Runs one batch: computes controls, steps all blocks, one thread per stepper, and writes every
// row. tasks/run/episodes.hpp runs many episodes as blocks on many threads.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/rows/row_sink.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/energy_balance_summary.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/progress.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// Optional outputs of a rollout besides q, v, controls and step results. Others are not computed.
struct RolloutOutputs {
  std::optional<std::vector<FieldOutput>> fields;  ///< none: the field of every sensor
  bool bodies = true, end_effectors = true;
  bool audit = false;   ///< balance of energy and momentum
  bool memory = false;  ///< shear state
  /// Rows at which q and v, bodies, end effectors and shear state are written; none: every row. If
  /// `states` are given, controls are not written, and steps only if they end at a row of q.
  OutputTimes states = {}, of_bodies = {}, of_end_effectors = {}, of_memory = {};
  std::vector<int> chosen_bodies = {};  ///< ascending; none: every body
};

struct RolloutOptions {
  std::int64_t steps = 0;
  int every = 0;  ///< steps between fields; 0: the scene's `every`, or 1 if it has none
  Precision precision = Precision::f64;  ///< of tactile fields
  /// Steps taken before row 0 by the run that this one continues. Times, controls and intervals of
  /// fields count them.
  std::int64_t first_step = 0;
  RolloutOutputs outputs = {};
};

struct RolloutSummary {
  std::int64_t steps = 0;  ///< done; fewer than requested if the caller stopped it
  StepCounts counts;       ///< of environments' steps, failing ones included
  std::optional<EnergyBalanceSummary> audit;  ///< if requested
  std::vector<FailedEnvironment> failures;    ///< in the order in which they failed
  bool stopped = false;                       ///< before its end
  double seconds = 0;                         ///< wall clock of the whole rollout, sink included
};

/// Steps the batch and writes every row to the sink: row 0 of the state, then for each step its
/// StepRow, the ActionRow if it ends a task's action, the StateRow after it, the MemoryRow and the
/// tactile rows due. Rows without requested quantities are not written. A tactile sensor is read
/// after steps K, 2K, …, so field k comes from row (k + 1) K of q. In a StepRow, an environment
/// that failed earlier has 0 iterations and its last status and residual. `program` must have
/// started every block; it takes all of them through a step in turn. `steppers`: one for each
/// thread that steps and reads blocks, all of the same options; rows are the same for any number of
/// them. Both `progress` and `stop` are used after each step.
/// Throws InputError without a stepper and when steps < 1, every < 0 or first_step < 0. Rethrows
/// exceptions of the sink.
RolloutSummary run_rollout(Batch& batch, std::span<Stepper> steppers, EpisodeProgram& program,
                           const RolloutOptions& options, RowSink& sink,
                           const ProgressCallback& progress = {}, const std::stop_token& stop = {});
/// Does the same for a scene. Also throws InputError when a table of controls is too short or was
/// laid out for another timestep.
RolloutSummary run_rollout(Batch& batch, std::span<Stepper> steppers,
                           const ControlProgram& controls, const RolloutOptions& options,
                           RowSink& sink, const ProgressCallback& progress = {},
                           const std::stop_token& stop = {});

/// Returns the tactile outputs. Throws InputError like check_outputs().
std::vector<FieldOutput> fields_of(const Model& model, const RolloutOutputs& outputs);
/// Steps between the fields of a sensor under these options, where a reading has no times of its
/// own.
int tactile_interval(const SensorInfo& sensor, const RolloutOptions& options);
/// When a reading is taken: its own times, else the interval of its sensor.
OutputTimes reading_times(const Model& model, FieldOutput output, const RolloutOptions& options);
/// Number of readings that a rollout takes.
std::int64_t tactile_frames(const Model& model, FieldOutput output, const RolloutOptions& options);

/// Memory that a rollout allocates besides batch and stepper [bytes].
double rollout_bytes(const Model& model, int environments, const RolloutOutputs& outputs = {});

}  // namespace tangere
