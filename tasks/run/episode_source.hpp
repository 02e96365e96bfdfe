// SPDX-License-Identifier: Apache-2.0
// What the player of episodes plays: a scene's or a task's program, and what its rows hold.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "engine/step/stepper.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere {

/// What it was made of must outlive it.
struct EpisodeSource {
  const Model* model = nullptr;
  StepperOptions solver;
  std::int64_t rows = 0;         ///< R, actions of an episode at most
  std::size_t action = 0;        ///< numbers of one
  std::size_t first_sensor = 0;  ///< place of its fields in widths
  /// Numbers of a row of q, v, then of a scene its end effectors, if it has any, and every sensor's
  /// field; of a task its observations.
  std::vector<std::size_t> widths;
  /// Episodes end when they like: only then is it known how long they are, so their blocks are
  /// handed on whole and in ascending order.
  bool whole = false;
  /// For one block of a batch.
  std::function<std::unique_ptr<EpisodeProgram>(const Batch&)> program;
};

/// Throws InputError when steps is no multiple of every, or the controls are too short, were laid out
/// for another timestep, or change while an action is held.
EpisodeSource source_of(const Model& model, const StepperOptions& solver,
                        const ControlProgram& controls, const EpisodeOptions& options);
EpisodeSource source_of(const Task& task, const Policy& policy, const EpisodeOptions& options);

/// The same without a program: what memory is reckoned by.
EpisodeSource shape_of(const Model& model, const EpisodeOptions& options);
EpisodeSource shape_of(const Task& task);

}  // namespace tangere
