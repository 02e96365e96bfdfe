// SPDX-License-Identifier: Apache-2.0
// Many episodes of a task, driven by a policy, to whoever stores them; and the same for the clock.
#pragma once

#include "tasks/run/benchmark_run.hpp"
#include "tasks/run/episodes.hpp"
#include "tasks/run/policy.hpp"

namespace tangere {

struct TaskEpisodeOptions {
  std::int64_t episodes = 0;
  std::vector<EpisodeRange> ranges = {};  ///< those of them to play, ascending; none: all
  std::uint64_t seed = 0;
  Precision precision = Precision::mixed;  ///< mixed: observations leave as float32
  int threads = 1;
};

struct TaskEpisodeSummary {
  EpisodeSummary run;  ///< environment_steps: actions
  std::int64_t simulation_steps = 0;
  std::int64_t successes = 0;  ///< of episodes that did not fail, as is the return
  double mean_return = 0;
};

/// Plays episodes 0 … episodes - 1, or the ranges of them, and hands them to the sink: each block
/// of 16 on one thread, in ascending order, while others are played. Neither threads nor the number
/// of episodes changes a bit of one. `policy` and `progress` are called by many threads, `progress`
/// by one at a time. Throws InputError for episodes or threads below 1 and passes on what the sink
/// throws.
TaskEpisodeSummary run_task_episodes(const Task& task, const Policy& policy,
                                     const TaskEpisodeOptions& options, EpisodeSink& sink,
                                     const EpisodeProgress& progress = {},
                                     const StopRequest& stop = {});
/// Memory that it takes [bytes].
double task_episode_bytes(const Task& task, const TaskEpisodeOptions& options);

/// `actions` environment steps of `environments` environments, starting anew as episodes end, timed
/// `repeat` times after a pass that makes checksums: of observations, rewards and flags.
/// Environment steps of the result are actions.
BenchmarkResult run_task_benchmark(const Task& task, const Policy& policy, int environments,
                                   std::int64_t actions, int repeat, const VectorOptions& options,
                                   const BenchmarkGoOn& go_on = {});

}  // namespace tangere
