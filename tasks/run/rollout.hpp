// SPDX-License-Identifier: Apache-2.0
// One unattended rollout of a batch: controls in, every row out. Serial: for many episodes on many
// threads, tasks/run/episodes.hpp.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/rows/row_sink.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

struct RolloutOptions {
  std::int64_t steps = 0;
  int every = 0;  ///< tactile every k-th step; 0: the scene's `every`, or 1 where it has none
  Precision precision = Precision::f64;  ///< of tactile fields
  /// Steps taken before row 0, by a run that this one continues: counted in times, controls and the
  /// rhythm of fields.
  std::int64_t first_step = 0;
};

/// An environment that no solution was found for. It keeps the state before that step.
struct FailedEnvironment {
  int environment;
  std::int64_t step;  ///< the first that failed, -1: before this run
  StepStatus status;  ///< why
};

struct RolloutSummary {
  std::int64_t steps = 0;              ///< done: fewer than asked when the caller stopped it
  std::int64_t environment_steps = 0;  ///< tried, failing ones included
  std::int64_t newton_iterations = 0;
  std::int64_t split_steps = 0;
  std::vector<FailedEnvironment> failures;  ///< in the order in which they failed
  bool stopped = false;                     ///< progress returned false
  double seconds = 0;                       ///< wall clock of the whole rollout, sink included
};

/// Called after each step with the number done; returns false to stop at this safe point.
using RolloutProgress = std::function<bool(std::int64_t done)>;

/// Steps the batch and hands every row to the sink: row 0 of the state, then for each step its
/// StepRow, the StateRow after it and the tactile rows due. Rows of a tactile sensor are read after
/// steps K, 2K, …: field k comes from row (k + 1) K of q. In a StepRow, an environment that failed
/// earlier has 0 iterations and its last status and residual. Throws InputError when steps < 1,
/// every < 0, first_step < 0, a table of controls is too short or was laid out for another
/// timestep, and passes on what the sink throws.
RolloutSummary run_rollout(Batch& batch, Stepper& stepper, const ControlProgram& controls,
                           const RolloutOptions& options, RowSink& sink,
                           const RolloutProgress& progress = {});

/// Drives a rollout in place of a ControlProgram.
class RolloutDriver {
 public:
  virtual ~RolloutDriver() = default;
  /// Controls (E, nu) of step t, which is about to be taken.
  virtual void drive(std::int64_t step, Batch& batch, std::span<double> u) = 0;
  /// Step t has been taken; rows may be handed to the sink.
  virtual void done(std::int64_t step, Batch& batch, RowSink& sink) = 0;
};
RolloutSummary run_rollout(Batch& batch, Stepper& stepper, RolloutDriver& driver,
                           const RolloutOptions& options, RowSink& sink,
                           const RolloutProgress& progress = {});

/// The step between fields of a sensor under these options.
int tactile_interval(const SensorInfo& sensor, const RolloutOptions& options);
/// Fields that a rollout reads of a sensor.
std::int64_t tactile_frames(const SensorInfo& sensor, const RolloutOptions& options);

/// Memory that a rollout allocates besides batch and stepper [bytes].
double rollout_bytes(const Model& model, int environments);

}  // namespace tangere
