// SPDX-License-Identifier: Apache-2.0
// What many episodes play, of a scene or a task, and what their rows hold.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "engine/rows/episode_channels.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/episode_options.hpp"
#include "tasks/run/episode_program.hpp"

namespace tangere {

inline constexpr int kBlockEpisodes = 16;  // lanes of a block of a Batch: one stepper's work

/// The program of a scene or a task, and the contents of its rows. The objects that it was made
/// from must outlive it.
struct EpisodeSource {
  const Model* model = nullptr;
  StepperOptions solver;
  std::int64_t rows = 0;                      ///< R, actions of an episode, at most
  std::size_t action = 0;                     ///< numbers in one action
  std::vector<std::array<double, 2>> bounds;  ///< of a scene's controls; a task has its own
  std::vector<EpisodeChannel> channels;       ///< of a row, besides the action
  /// Episodes may end at any time. Their length is then known only at the end, so their blocks
  /// leave whole and in ascending order.
  bool whole = false;
  int steps_per_row = 1;  ///< K
  /// Makes the program for one block of a batch.
  std::function<std::unique_ptr<EpisodeProgram>(const Batch&)> program;
};

/// Throws InputError when steps is no multiple of every, and when the controls are too short, were
/// laid out for another timestep, or change while an action is held.
EpisodeSource source_of(const Model& model, const StepperOptions& solver,
                        const ControlProgram& controls, const EpisodeOptions& options);
EpisodeSource source_of(const Task& task, const Policy& policy, const EpisodeOptions& options);

/// Returns the same without a program, to compute memory sizes.
EpisodeSource shape_of(const Model& model, const EpisodeOptions& options);
EpisodeSource shape_of(const Task& task, const EpisodeOptions& options);

/// Whether a row of an episode has the numbers of a name, and how many rows below it have.
bool is_taken(const EpisodeSource& source, std::size_t name, std::int64_t row);
std::size_t taken_before(const EpisodeSource& source, std::size_t name, std::int64_t row);

/// Rows of a piece: as many as fit, at least one; all of them if blocks leave whole. The last piece
/// may have fewer.
int piece_rows(const EpisodeSource& source, const EpisodeOptions& options);
/// Buffers of one slot [bytes].
double piece_bytes(const EpisodeSource& source, const EpisodeOptions& options);

}  // namespace tangere
