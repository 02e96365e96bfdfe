// SPDX-License-Identifier: Apache-2.0
// Computes rollouts of a scene with gradients of losses over them, and episodes of a task with
// gradients of their returns: forward, then back, block by block on all threads.
#pragma once

#include <memory>
#include <span>
#include <stop_token>

#include "engine/derivative/loss.hpp"
#include "engine/rows/episode_sink.hpp"
#include "engine/step/batch.hpp"
#include "tasks/gradients/tape_options.hpp"

namespace tangere {

class Task;

/// Owns the threads and their scratch. Use it for many rollouts of one model, as in a descent.
class GradientRollouts {
 public:
  /// `losses` must outlive this object. Throws InputError when length or threads is below 1, and
  /// when tape_bytes is too small for a rollout with checkpoints.
  GradientRollouts(const Model& model, const TapeOptions& options,
                   std::span<const RolloutLoss* const> losses);
  ~GradientRollouts();
  GradientRollouts(GradientRollouts&&) noexcept;
  GradientRollouts& operator=(GradientRollouts&&) noexcept;

  /// Returns gradients of every loss over `length` steps from the states of `start`, which does not
  /// change. The bits depend neither on the number of threads nor on tape_bytes. `stop` ends it
  /// before any step. Throws InputError when `start` is of another Model.
  GradientSummary run(const Batch& start, const StepControls& controls,
                      const std::stop_token& stop = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Does the same for one rollout.
GradientSummary rollout_gradients(const Batch& start, const StepControls& controls,
                                  const TapeOptions& options,
                                  std::span<const RolloutLoss* const> losses);

/// Runs episodes of a seed in blocks of 16 on all threads. `actions` chooses every action from the
/// full view; derivatives are by the actions, at the chosen values. The bits depend neither on the
/// number of threads, nor on the other episodes, nor on tape_bytes. A requested `stop` takes effect
/// before the next action. Throws InputError for an action that is not finite, for numbers of
/// episodes, actions or threads out of range, for a tape_bytes that does not hold the checkpoints,
/// and for a task that restarts without a derivative of its restarts.
TaskGradients task_gradients(const Task& task, const TaskActions& actions, std::uint64_t seed,
                             EpisodeRange episodes, const TapeOptions& options,
                             const std::stop_token& stop = {});

/// Make room for gradients, filled with zeros. options.length must be the final number.
GradientSummary empty_gradients(const Model& model, int environments, const TapeOptions& options,
                                std::size_t losses);
TaskGradients empty_gradients(const Task& task, std::int64_t episodes, const TapeOptions& options);

/// Memory of gradients and of the tapes of all threads [bytes].
double gradient_bytes(const Model& model, int environments, const TapeOptions& options, int losses);
double gradient_bytes(const Task& task, std::int64_t episodes, const TapeOptions& options);

}  // namespace tangere
