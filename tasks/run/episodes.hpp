// SPDX-License-Identifier: Apache-2.0
// Many episodes on many threads: blocks of 16 episodes flow through simulate, encode and write,
// with a limit on how many are on their way.
//
//   blocks -> limiter -> simulate -> encode -> write (one at a time) -> the limiter's next block
//                           ^                    |
//                           +---- next rows -----+
//
// Of a task, whose blocks are one piece each, they wait before write for the blocks before them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/rows/episode_sink.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/policy.hpp"

namespace tangere {

struct EpisodeOptions {
  std::int64_t episodes = 0;
  std::vector<EpisodeRange> ranges = {};  ///< those of them to simulate, ascending; none: all
  std::int64_t steps = 0;                 ///< of a scene's episode, a multiple of `every`
  int every = 1;  ///< K: steps that a scene's action is held for, and between observations
  std::uint64_t seed = 0;
  Precision precision =
      Precision::f64;  ///< mixed: fields computed in it, observations leave as float32
  int threads = 1;
  /// At most so many blocks of 16 episodes are held in memory: of a task those, too, that wait for
  /// an earlier one to be written, because episodes differ in length.
  int blocks_in_flight = 2;
  /// Row buffers of one block in flight [bytes]: a piece has as many rows as fit, at least one. A
  /// task's blocks are one piece each, whatever that takes.
  std::size_t piece_bytes = std::size_t{32} << 20;
};

struct EpisodeSummary {
  std::int64_t episodes = 0;           ///< finished, failed ones included
  std::int64_t rows = 0;               ///< of episodes that did not fail
  std::int64_t environment_steps = 0;  ///< tried, failing ones included; of a task: actions
  std::int64_t simulation_steps = 0;   ///< the same of a scene
  std::int64_t newton_iterations = 0;
  std::int64_t split_steps = 0;
  std::int64_t successes = 0;           ///< of a task's episodes that did not fail
  double mean_return = 0;               ///< of the same
  std::vector<FailedEpisode> failures;  ///< in ascending order
  int peak_blocks_in_flight = 0;
  bool stopped = false;  ///< StopRequest said so; what was not finished is lost
  double seconds = 0;    ///< wall clock of the whole run, sink included
  /// Sums over threads: stepping, turning rows into what is stored (compression included), and what
  /// the one thread that writes was busy for.
  double simulation_seconds = 0, encoding_seconds = 0, writing_seconds = 0;
};

/// Called after each row of each block, by one thread at a time, with the environment steps done.
using EpisodeProgress = std::function<void(std::int64_t environment_steps)>;
/// Asked before every step, by all threads at once; true ends the run without finishing a block.
using StopRequest = std::function<bool()>;

/// Simulates episodes 0 … episodes - 1, or the ranges of them, and hands them to the sink. What is
/// drawn for an episode is keyed by (seed, episode), so neither `threads` nor `blocks_in_flight`
/// changes a bit. Throws InputError when a number is out of its range, steps is no multiple of
/// every, the controls are too short, were laid out for another timestep, or change while an action
/// is held; passes on what the sink throws, after all threads have ended.
EpisodeSummary run_episodes(const Model& model, const StepperOptions& solver,
                            const ControlProgram& controls, const EpisodeOptions& options,
                            EpisodeSink& sink, const EpisodeProgress& progress = {},
                            const StopRequest& stop = {});
/// The same of a task's episodes, played by a policy, which is asked by many threads: each block in
/// one piece, blocks in ascending order.
EpisodeSummary run_episodes(const Task& task, const Policy& policy, const EpisodeOptions& options,
                            EpisodeSink& sink, const EpisodeProgress& progress = {},
                            const StopRequest& stop = {});

/// `ranges`, or the one that holds all episodes. Throws InputError when one begins within a block
/// of 16, ends within one (but for the last episode), is empty or lies outside.
std::vector<EpisodeRange> checked_ranges(const std::vector<EpisodeRange>& ranges,
                                         std::int64_t episodes);

/// Actions of an episode, R = steps / every. Throws InputError when it is not whole.
std::int64_t action_rows(const EpisodeOptions& options);

/// K: `every` when positive, else what the scene's sensors ask for, else 1. Throws InputError when
/// they disagree.
int action_interval(const Model& model, int every);

/// Threads that this process may run at once.
int available_threads();

/// Memory that a run takes [bytes].
double episode_bytes(const Model& model, const EpisodeOptions& options);
double episode_bytes(const Task& task, const EpisodeOptions& options);

}  // namespace tangere
