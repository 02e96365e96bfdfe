// SPDX-License-Identifier: Apache-2.0
// Checks gradients of one environment's rollout and of one episode's return: the adjoint against
// central differences of the whole and against tangents in dual numbers.
#pragma once

#include <functional>
#include <memory>

#include "tasks/gradients/gradient_compare.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/task_gradients.hpp"

namespace tangere {

struct CheckOptions : CompareOptions {
  std::int64_t steps = 0;
  StepperOptions stepper;
};

/// Checks environment 0 of `start`. Throws InputError when a step of its rollout finds no solution,
/// and when it continues a run of a scheme of two steps.
GradientCheck check_gradient(const Batch& start, const StepControls& controls,
                             const RolloutLoss& loss, const CheckOptions& options);

/// `seed` also seeds the episode.
struct TaskCheckOptions : CompareOptions {
  std::int64_t episode = 0, actions = 0;  ///< actions: at most this many; 0: the task's horizon
  StepperOptions stepper;
};

/// Makes the task on a scene that differs from its own in some numbers.
using TaskMaker = std::function<std::unique_ptr<Task>(const Scene& scene)>;

struct TaskGradientCheck : GradientCheck {
  std::int64_t actions = 0;  ///< taken until the end
};

/// Checks one episode that `actions` plays. Differences move the chosen actions (moved slightly
/// inward at their bounds), the state before the first action, and the scene's numbers. All random
/// draws stay the same. The tangent propagates the task's own derivatives forward and takes those
/// of the steps in dual numbers. Throws InputError when the episode finds no solution.
TaskGradientCheck check_task_gradient(const Task& task, const TaskMaker& make,
                                      const TaskActions& actions, const TaskCheckOptions& options);

}  // namespace tangere
