// SPDX-License-Identifier: Apache-2.0
// Runs many episodes on many threads. Blocks of 16 episodes pass through simulate, encode and
// write. A limiter bounds the number of blocks in flight.
//
//   blocks -> limiter -> simulate -> encode -> write (one at a time) -> the limiter's next block
//                           ^                    |
//                           +---- next rows -----+
//
// The blocks of a task are one chunk each and are written in ascending order.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/episode_options.hpp"
#include "tasks/run/policy.hpp"
#include "tasks/run/progress.hpp"

namespace tangere {

/// Simulates episodes 0 … episodes - 1, or those of `ranges`, and writes them to the sink. Draws
/// for an episode are keyed by (seed, episode), so neither `threads` nor `blocks_in_flight` changes
/// a bit. Throws InputError when a number is out of its range, when steps is no multiple of every,
/// and when the controls are too short, were laid out for another timestep, or change while an
/// action is held. `progress` gets environment steps after each row of each block; a requested
/// `stop` ends the run, and unfinished blocks are lost. Rethrows exceptions of the sink after all
/// threads have ended.
EpisodeSummary run_episodes(const Model& model, const StepperOptions& solver,
                            const ControlProgram& controls, const EpisodeOptions& options,
                            EpisodeSink& sink, const ProgressCallback& progress = {},
                            const std::stop_token& stop = {});
/// The same for a task's episodes. Many threads call the policy. Each block is one chunk; blocks
/// are written in ascending order.
EpisodeSummary run_episodes(const Task& task, const Policy& policy, const EpisodeOptions& options,
                            EpisodeSink& sink, const ProgressCallback& progress = {},
                            const std::stop_token& stop = {});

/// Returns `ranges`, or one range with all episodes if there are none. Throws InputError when a
/// range begins or ends within a block of 16 (except at the last episode), is empty, or lies
/// outside.
std::vector<EpisodeRange> checked_ranges(const std::vector<EpisodeRange>& ranges,
                                         std::int64_t episodes);

/// Returns K, the steps of an action: `every` if positive, else the interval of the scene's
/// sensors, else 1. Throws InputError when sensors have different intervals.
int action_interval(const Model& model, int every);

/// Threads that this process may run at once.
int available_threads();

/// Memory of a run besides the model [bytes].
double episode_bytes(const Model& model, const EpisodeOptions& options);
double episode_bytes(const Task& task, const EpisodeOptions& options);

}  // namespace tangere
