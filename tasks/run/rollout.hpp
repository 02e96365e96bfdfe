// SPDX-License-Identifier: Apache-2.0
// Runs one batch: for each step it computes the controls, steps all blocks on as many threads as
// there are steppers, and writes a row. tasks/run/episodes.hpp runs many episodes as blocks on many
// threads.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/rows/channel.hpp"
#include "engine/rows/run_facts.hpp"
#include "engine/sense/energy_balance.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/progress.hpp"
#include "tasks/run/rollout_options.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere {

class EpisodeProgram;

struct RolloutSummary {
  std::int64_t steps = 0;  ///< done; fewer than requested if the caller stopped it
  StepCounts counts;       ///< of environments' steps, failing ones included
  std::optional<EnergyBalanceSummary> audit;  ///< if requested
  std::vector<FailedEnvironment> failures;    ///< in the order in which they failed
  bool stopped = false;                       ///< before its end
  double seconds = 0;                         ///< wall clock of the whole rollout, sink included
};

/// Returns the channels of a rollout of `batch`, in the order of RowSink::write(). `facts` of a
/// task name it. Throws InputError like check_outputs(), for an unknown body and for a sensor whose
/// name cannot be a name in a file.
Recording rollout_recording(const Batch& batch, const Stepper& stepper,
                            const RolloutOptions& options, const RunFacts& facts);

/// Steps the batch and writes rows to the sink: one of the start, then after each step the channels
/// of the step, those of the state that are due, and after the last step of a task's action those
/// of the action. Channels that are not requested are not computed. A tactile sensor is read after
/// steps K, 2K, …, so field k comes from row (k + 1) K of q. An environment that failed earlier has
/// 0 iterations and its last status and residual. `program` must have started every block; it takes
/// all of them through a step in turn. `steppers`: one for each thread that steps and reads blocks,
/// all of the same options; rows are the same for any number of them. After each step `progress` is
/// called and `stop` is tested. Throws InputError without a stepper and when steps < 1, every < 0
/// or first_step < 0. Rethrows exceptions of the sink.
RolloutSummary run_rollout(Batch& batch, std::span<Stepper> steppers, EpisodeProgram& program,
                           const RolloutOptions& options, RowSink& sink,
                           const ProgressCallback& progress = {}, const std::stop_token& stop = {});
/// Does the same for a scene. Also throws InputError when a table of controls is too short or was
/// laid out for another timestep.
RolloutSummary run_rollout(Batch& batch, std::span<Stepper> steppers,
                           const ControlProgram& controls, const RolloutOptions& options,
                           RowSink& sink, const ProgressCallback& progress = {},
                           const std::stop_token& stop = {});

}  // namespace tangere
