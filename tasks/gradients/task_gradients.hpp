// SPDX-License-Identifier: Apache-2.0
// Computes the return of a task's episodes and its derivatives by their actions, by the state
// before the first action and by the scene's numbers.
#pragma once

#include "tasks/gradients/task_gradient_options.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

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
