// SPDX-License-Identifier: Apache-2.0
// Options and summary of run_episodes().
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/rows/episode_sink.hpp"
#include "engine/scene/output_times.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere {

struct EpisodeOptions {
  std::int64_t episodes = 0;
  std::vector<EpisodeRange> ranges = {};  ///< episodes to simulate, ascending; none: all
  std::int64_t steps = 0;                 ///< of a scene's episode, a multiple of `every`
  int every = 1;  ///< K: steps for which a scene's action is held, and between observations
  std::uint64_t seed = 0;
  /// What rows hold, by names with times in steps, as episode_channels() takes them; none: all that
  /// a task observes, of a scene everything except bodies.
  std::vector<TimedName> record = {};
  Precision precision =
      Precision::f64;  ///< mixed: fields are computed in it, observations leave as float32
  int threads = 1;
  /// Limit of blocks of 16 episodes in memory. For a task this includes blocks that wait until an
  /// earlier one is written, because episodes differ in length.
  int blocks_in_flight = 2;
  /// Row buffers of one block in flight [bytes]. A piece has as many rows as fit, at least one. A
  /// block of a task is always one piece.
  std::size_t piece_bytes = std::size_t{32} << 20;
};

struct EpisodeSummary {
  std::int64_t episodes = 0;  ///< finished, failed ones included
  std::int64_t rows = 0;      ///< of episodes that did not fail
  /// Of a scene: steps tried, failing ones included. Of a task: actions.
  std::int64_t environment_steps = 0;
  StepCounts counts;                    ///< of a scene: of environment_steps
  std::int64_t successes = 0;           ///< of a task's episodes that did not fail
  double mean_return = 0;               ///< over the same episodes
  std::vector<FailedEpisode> failures;  ///< in ascending order
  int peak_blocks_in_flight = 0;
  bool stopped = false;  ///< before its end; unfinished blocks are lost
  double seconds = 0;    ///< wall clock of the whole run, sink included
  /// Sums over threads: time for stepping, for turning rows into the stored form (compression
  /// included), and for the one thread that writes.
  double simulation_seconds = 0, encoding_seconds = 0, writing_seconds = 0;
};

/// Actions of an episode, R = steps / every. Throws InputError when R is not whole.
std::int64_t action_rows(const EpisodeOptions& options);
/// Throws InputError when a number of `what` is below 1.
void check_at_least_one(const char* what, std::int64_t value);

}  // namespace tangere
