// SPDX-License-Identifier: Apache-2.0
// Times whole episodes: a scene with its controls and readings of every tactile field, or a task
// with its policy, rewards and observations. Nothing is written. Threads take blocks of
// environments without synchronisation between blocks.
#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/step/batch.hpp"
#include "engine/step/control.hpp"
#include "tasks/run/benchmark_options.hpp"
#include "tasks/run/policy.hpp"

namespace tangere {

/// Times of one pass over the whole episode.
struct BenchmarkTime {
  double seconds = 0;      ///< wall clock
  double cpu_seconds = 0;  ///< of the whole process
};

struct BenchmarkResult {
  std::vector<BenchmarkTime> times;  ///< one per timed pass, in their order
  /// Steps tried in one pass, failing ones included; of a task: actions.
  std::int64_t environment_steps = 0;
  /// Of one pass. Of a scene: of environment_steps; of a task: of its actions and resets.
  StepCounts counts;
  std::int64_t tactile_points = 0;          ///< read in one pass
  std::vector<FailedEnvironment> failures;  ///< in the order of their steps
  /// One checksum per environment. It chains the bits of every field in the order of time, then of
  /// the final state; for a task those of observations, rewards and flags. It depends on the
  /// environment's episode, but not on threads, blocks or the size of the batch.
  std::vector<std::uint64_t> checksums;
  bool stopped = false;  ///< before its end; the times are of complete passes only

  /// Returns the sum of the checksums modulo 2^64, which does not depend on their order.
  [[nodiscard]] std::uint64_t checksum() const;
  /// Returns the pass with the least wall clock time. There must be one.
  [[nodiscard]] BenchmarkTime best() const;
  /// Returns the medians of wall clock and CPU time, each on its own. There must be a pass.
  [[nodiscard]] BenchmarkTime median() const;
};

/// Runs the episode that begins with `start` once for checksums. This run also warms caches, pages
/// and threads. Then it times `repeat` passes, which contain only controls, steps and readings. An
/// environment that fails is not read again. `stop` ends it before any step of a block. Throws
/// InputError for threads or repeat < 1 and for what a rollout refuses: steps < 1, every < 0,
/// controls that are too short or laid out for a timestep other than the scene's.
BenchmarkResult run_benchmark(const Batch& start, const ControlProgram& controls,
                              const BenchmarkOptions& options, const std::stop_token& stop = {});

/// Does the same for a task's episodes, played by a policy from a fresh batch. Environments start
/// new episodes when theirs end, as in a VectorTask.
BenchmarkResult run_benchmark(const Batch& start, const Task& task, const Policy& policy,
                              const BenchmarkOptions& options, const std::stop_token& stop = {});

/// Memory that run_benchmark takes besides `start` [bytes].
double benchmark_bytes(const Model& model, int environments, const BenchmarkOptions& options);
double benchmark_bytes(const Task& task, int environments, const BenchmarkOptions& options);

}  // namespace tangere
