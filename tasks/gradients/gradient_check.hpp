// SPDX-License-Identifier: Apache-2.0
// Checks gradients of one environment's rollout and of one episode's return: the adjoint against
// central differences of the whole and against tangents in dual numbers.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tasks/catalogue/task.hpp"
#include "tasks/gradients/gradients.hpp"

namespace tangere {

struct CheckOptions {
  std::int64_t length = 0;   ///< as in TapeOptions
  StepperOptions stepper;    ///< of the rollout or the episode
  std::int64_t episode = 0;  ///< of a task
  int entries = 24;          ///< compared entries per input, drawn if there are more; 0: all
  std::uint64_t seed = 0;    ///< for that draw, the directions and a task's episode
  double settled =
      3e-6;  ///< agreement of neighbouring step sizes, of the gradient's norm; else a kink
  double tolerance = 1e-4;  ///< largest error of a check that passes, of a gradient's norm
};

/// One kind of input. Errors are relative to the norm of the gradient by it; for numbers of the
/// scene, by their relative changes.
struct CheckedInput {
  std::string name;          ///< "u" or "actions", "q", "v", "numbers", "points"
  std::size_t entries = 0;   ///< in the gradient
  std::size_t compared = 0;  ///< with differences
  std::size_t kinks =
      0;  ///< entries left out: their differences do not settle, or their runs find no solution
  double norm = 0;  ///< of the gradient
  double scale =
      0;  ///< reference of the errors: that norm, or the norm of the differences if larger
  bool influence = true;  ///< false: all derivatives and differences are negligible, none compared
  double difference_error = 0;          ///< largest among the compared entries
  std::string worst;                    ///< the entry of that error
  std::vector<std::size_t> to_explain;  ///< the first entries at kinks; that error's if too large
  double tangent_error = 0;             ///< |g·d - tangent|/(|g| |d|) along a random direction
};

struct GradientCheck {
  double loss = 0;
  std::int64_t length = 0;  ///< steps, or actions that were taken until the end
  std::vector<CheckedInput> inputs;
  double tolerance = 0;  ///< that of the options
  /// Sentences on why derivatives may not exist: at kinks, and where an error is too large.
  std::vector<std::string> reasons;
  /// Whether something was compared, and no error exceeds the tolerance.
  [[nodiscard]] bool passed() const { return entries() > 0 && max_relative_error() <= tolerance; }
  [[nodiscard]] double max_relative_error() const;
  [[nodiscard]] std::size_t entries() const;  ///< that are compared
  [[nodiscard]] std::size_t kinks() const;
};

/// Checks environment 0 of `start`. Throws InputError when a step of its rollout finds no solution,
/// and when it continues a run of a scheme of two steps.
GradientCheck check_gradient(const Batch& start, const StepControls& controls,
                             const RolloutLoss& loss, const CheckOptions& options);

/// Makes the task on a scene that differs from its own in some numbers.
using TaskMaker = std::function<std::unique_ptr<Task>(const Scene& scene)>;

/// Checks episode options.episode, which `actions` plays. Differences move the chosen actions
/// (moved slightly inward at their bounds), the state before the first action, and the scene's
/// numbers. All random draws stay the same. The tangent propagates the task's own derivatives
/// forward and takes those of the steps in dual numbers. Throws InputError when the episode finds
/// no solution.
GradientCheck check_task_gradient(const Task& task, const TaskMaker& make,
                                  const TaskActions& actions, const CheckOptions& options);

}  // namespace tangere
