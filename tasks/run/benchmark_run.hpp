// SPDX-License-Identifier: Apache-2.0
// Whole episodes for the clock: a scene's controls in and every tactile field read, or a task's
// policy in and every action judged; nothing written. Blocks of environments are spread over
// threads and never wait for each other.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/control.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere {

/// How tactile fields are read.
enum class FrameKind {
  none,     ///< not at all
  dense,    ///< every point of a sensor, (points, 3) [N], in memory of the environment's own
  compact,  ///< the 8×8 tiles that something touches
};
const char* to_string(FrameKind value);

struct BenchmarkOptions {
  RolloutOptions rollout;  ///< steps (of a task: actions), and of a scene the interval of fields
  FrameKind frames = FrameKind::dense;   ///< of a scene
  Precision precision = Precision::f64;  ///< of the fields: a scene's mixed ones are kept in float
  int threads = 1;
  int repeat = 3;  ///< timed passes over the whole episode
};

/// Of one pass over the whole episode.
struct BenchmarkTime {
  double seconds = 0;      ///< wall clock
  double cpu_seconds = 0;  ///< of the whole process
};

struct BenchmarkResult {
  std::vector<BenchmarkTime> times;  ///< one per timed pass, in their order
  std::int64_t environment_steps =
      0;  ///< tried in one pass, failing ones included; a task's: actions
  std::int64_t simulation_steps =
      0;  ///< the same of a scene; of a task those of its actions, resets included
  std::int64_t newton_iterations = 0;       ///< of one pass, over simulation_steps
  std::int64_t tactile_points = 0;          ///< read in one pass
  std::vector<FailedEnvironment> failures;  ///< in the order of their steps
  /// One per environment: chains the bits of every field in the order of time, then of the final
  /// state; of a task those of observations, rewards and flags. Depends on the environment's
  /// episode, not on threads, blocks or the size of the batch.
  std::vector<std::uint64_t> checksums;
  bool stopped = false;  ///< `go_on` returned false; the times are of complete passes only

  /// Sum of the checksums modulo 2^64: in any order the same.
  [[nodiscard]] std::uint64_t checksum() const;
  /// The pass that took the least wall clock; there must be one.
  [[nodiscard]] BenchmarkTime best() const;
  /// Medians of wall clock and of CPU time, each on its own; there must be a pass.
  [[nodiscard]] BenchmarkTime median() const;
};

/// Continues a checksum with the bits of numbers: +0 and -0 differ. The checksum of an environment
/// begins with the number of its episode.
std::uint64_t chain_bits(std::uint64_t checksum, std::span<const double> numbers);
std::uint64_t chain_bits(std::uint64_t checksum, std::span<const float> numbers);

/// Asked before each step of each block, from any thread; false stops the run there.
using BenchmarkGoOn = std::function<bool()>;

/// Runs the episode that begins with `start` once for checksums, which also warms caches, pages and
/// threads, then `repeat` times against the clock with nothing but controls, steps and readings
/// between start and stop. An environment that fails is not read again. Throws InputError for
/// threads or repeat < 1 and for what a rollout refuses: steps < 1, every < 0, controls that are
/// too short or laid out for another timestep than the scene's.
BenchmarkResult run_benchmark(const Batch& start, const ControlProgram& controls,
                              const BenchmarkOptions& options, const BenchmarkGoOn& go_on = {});

/// The same of a task's episodes, played by a policy from a batch that nothing has been done to:
/// environments start anew as their episodes end, as those of a VectorTask do.
BenchmarkResult run_benchmark(const Batch& start, const Task& task, const Policy& policy,
                              const BenchmarkOptions& options, const BenchmarkGoOn& go_on = {});

/// Memory that run_benchmark takes besides `start` [bytes].
double benchmark_bytes(const Model& model, int environments, const BenchmarkOptions& options);
double benchmark_bytes(const Task& task, int environments, const BenchmarkOptions& options);

}  // namespace tangere
