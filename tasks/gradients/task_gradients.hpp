// SPDX-License-Identifier: Apache-2.0
// The return of a task's episodes and its derivatives by their actions, by the state of the first
// and by the scene's numbers.
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
  std::int64_t actions = 0;  ///< of an episode at most; 0: the task's horizon
  int threads = 1;
  StepperOptions stepper;
  Precision precision = Precision::
      mixed;  ///< of what moments hold of tactile fields; derivatives are taken in double
  bool parameters = false;  ///< by the scene's numbers too (engine/derivative/number_gradients.hpp)
  /// The states on a thread's tapes may take so much [bytes]; longer episodes are run again from
  /// checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Of every episode, A = actions. What belongs to the reset (settling, an opening) is taken as
/// given, and so is what is drawn.
struct TaskGradients : GradientCounts {
  std::vector<double> value;         ///< (E) sum of rewards until the end
  std::vector<std::int64_t> length;  ///< (E) actions until the end
  std::vector<double> action;        ///< (E, A, action) as chosen; zeros after the end
  std::vector<double> by_action;     ///< (E, A, action); 0 for one beyond its bounds
  std::vector<double> by_q,
      by_v;  ///< (E, nv) by the state where the first action begins, positions along the dofs of v
  std::vector<double> by_parameter;  ///< (E, NumberGradients::count()) or empty
};

/// Episodes of `task` in blocks of 16 on all threads. `actions` chooses every action, looking at
/// what it likes; derivatives are by the actions, at what it chose. The same bits for any number of
/// threads and of episodes beside one, and whatever tape_bytes. Throws InputError for an action
/// that is not finite, for numbers of episodes, actions or threads out of range, for a tape_bytes
/// that does not hold checkpoints, and for a task that restarts without a derivative of its
/// restarts.
TaskGradients task_gradients(const Task& task, const TaskActions& actions,
                             const TaskGradientOptions& options, const GradientGoOn& go_on = {});

/// Room for them, zeros; options.actions is the number there are.
TaskGradients empty_task_gradients(const Task& task, const TaskGradientOptions& options);

/// Memory that it takes [bytes].
double task_gradient_bytes(const Task& task, const TaskGradientOptions& options);

}  // namespace tangere
