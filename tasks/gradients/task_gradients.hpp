// SPDX-License-Identifier: Apache-2.0
// Computes the return of a task's episodes and its derivatives by their actions, by the state
// before the first action and by the scene's numbers.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

struct TaskGradientOptions {
  std::int64_t episodes = 0, first_episode = 0;
  std::uint64_t seed = 0;
  std::int64_t actions = 0;  ///< of an episode, at most; 0: the task's horizon
  int threads = 1;
  StepperOptions stepper;
  Precision precision =
      Precision::mixed;  ///< of the tactile fields in moments; derivatives are in double
  bool parameters =
      false;  ///< also by the scene's numbers (engine/derivative/number_gradients.hpp)
  /// Limit for the states on a thread's tapes [bytes]. Longer episodes are run again from
  /// checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Results for every episode, A = actions. The reset (settling, an opening) and all random draws
/// count as given.
struct TaskGradients : GradientCounts {
  std::vector<double> value;         ///< (E) sum of rewards until the end
  std::vector<std::int64_t> length;  ///< (E) actions until the end
  std::vector<double> action;        ///< (E, A, action) as chosen; zeros after the end
  std::vector<double> by_action;     ///< (E, A, action); 0 for a component beyond its bounds
  std::vector<double> by_q,
      by_v;  ///< (E, nv) by the state at the first action, positions along the dofs of v
  std::vector<double> by_parameter;  ///< (E, NumberGradients::count()) or empty
};

/// Plays episodes of `task` in blocks of 16 on all threads. `actions` chooses every action and may
/// look at anything; derivatives are by the actions, at the values that it chose. The bits depend
/// neither on the number of threads, nor on the other episodes, nor on tape_bytes. Throws
/// InputError for an action that is not finite, for numbers of episodes, actions or threads out of
/// range, for a tape_bytes that does not hold the checkpoints, and for a task that restarts without
/// a derivative of its restarts.
TaskGradients task_gradients(const Task& task, const TaskActions& actions,
                             const TaskGradientOptions& options, const GradientGoOn& go_on = {});

/// Makes room for results, filled with zeros. options.actions must be the final number, not 0.
TaskGradients empty_task_gradients(const Task& task, const TaskGradientOptions& options);

/// Memory that task_gradients takes [bytes].
double task_gradient_bytes(const Task& task, const TaskGradientOptions& options);

}  // namespace tangere
