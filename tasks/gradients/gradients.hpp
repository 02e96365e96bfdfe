// SPDX-License-Identifier: Apache-2.0
// Computes rollouts of a scene with gradients of losses over them, and episodes of a task with
// gradients of their returns: forward, then back, block by block on all threads.
#pragma once

#include <memory>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/derivative/loss.hpp"
#include "engine/rows/episode_sink.hpp"
#include "engine/step/batch.hpp"
#include "tasks/gradients/tape_options.hpp"
#include "tasks/gradients/task_rollout.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// Gradient of one loss or of the return, for every environment or episode. An environment that
/// fails contributes its states until then and stands still afterwards.
struct LossGradient {
  std::vector<double> value;       ///< (E)
  std::vector<double> u;           ///< (E, steps, nu) by controls; of a task (E, A, action)
  std::vector<double> q, v;        ///< (E, nv) by the initial state; q along the dofs of v
  std::vector<double> parameters;  ///< (E, NumberGradients::count()) or empty
  std::vector<double> points;      ///< (E, tactile_points(model), kPointNumbers) or empty
};

/// How the rollouts or episodes went.
struct GradientCounts {
  /// In the order of environments. For a task: in the order of its episodes; steps count actions,
  /// and -1 is the reset.
  std::vector<FailedEnvironment> failures;
  std::int64_t newton_iterations = 0;
  std::int64_t recomputed_steps = 0;  ///< from checkpoints, counted by block
  bool stopped = false;               ///< before the end: gradients are incomplete
};

struct GradientSummary : GradientCounts {
  std::vector<LossGradient> losses;
};

/// The value is the sum of rewards until the end. A derivative by a component of an action beyond
/// its bounds is 0. The initial state is that at the first action: the reset (settling, an opening)
/// and all random draws count as given.
struct TaskGradients : GradientCounts, LossGradient {
  std::vector<std::int64_t> length;  ///< (E) actions until the end
  std::vector<double> action;        ///< (E, A, action) as chosen; zeros after the end
};

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

/// Plays episodes of a seed in blocks of 16 on all threads. `actions` chooses every action and may
/// look at anything; derivatives are by the actions, at the values that it chose. The bits depend
/// neither on the number of threads, nor on the other episodes, nor on tape_bytes. `stop` ends it
/// before any action. Throws InputError for an action that is not finite, for numbers of episodes,
/// actions or threads out of range, for a tape_bytes that does not hold the checkpoints, and for a
/// task that restarts without a derivative of its restarts.
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
