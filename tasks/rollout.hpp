// SPDX-License-Identifier: Apache-2.0
// An unattended rollout: controls in, rows out. Serial; the flow graph over blocks takes its place later.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/batch.hpp"
#include "engine/control.hpp"
#include "engine/row_sink.hpp"
#include "engine/stepper.hpp"

namespace tangere {

struct RolloutOptions {
  std::int64_t steps = 0;
  int every = 0;  ///< tactile every k-th step; 0: the scene's `every`, or 1 where it has none
};

struct RolloutSummary {
  std::int64_t environment_steps = 0;
  std::int64_t newton_iterations = 0;
  std::int64_t split_steps = 0;
  std::vector<int> failed_environments;
  double seconds = 0;  ///< wall clock of the whole rollout, sink included
};

/// Called after each step with the number done; return false to stop at this safe point.
using RolloutProgress = bool (*)(std::int64_t done, void* context);

/// Rows of a tactile sensor are read after steps K, 2K, …: field k comes from row (k + 1) K of q.
RolloutSummary run_rollout(Batch& batch, Stepper& stepper, const ControlProgram& controls,
                           const RolloutOptions& options, RowSink& sink, RolloutProgress progress = nullptr,
                           void* context = nullptr);

/// The step between fields of a sensor under these options.
int tactile_interval(const SensorInfo& sensor, const RolloutOptions& options);

}  // namespace tangere
