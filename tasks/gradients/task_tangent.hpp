// SPDX-License-Identifier: Apache-2.0
// How an episode's return changes along a direction, forward: a task's own derivatives row by row,
// its steps in dual numbers. The second route that gradients of returns are checked by.
#pragma once

#include <span>
#include <vector>

#include "engine/derivative/tangent.hpp"
#include "tasks/gradients/gradient_compare.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

class TaskTangent {
 public:
  /// Plays lane 0 of `rollout`, which has just started, with `actions`: (A, action), within their
  /// bounds.
  TaskTangent(TaskRollout& rollout, std::span<const double> actions, const StepperOptions& options);

  [[nodiscard]] double along(const InputDirection& direction);

 private:
  /// A change of what a task looks at.
  struct ViewTangent {
    std::vector<std::vector<double>> q, v, end_effectors, tactile;  // per moment
    std::vector<double> memory, action;
  };
  struct OwnCotangent;
  void begin(std::size_t action);
  void take_steps(std::size_t action, const InputDirection& d, ViewTangent& seen);
  void look(std::size_t action, std::size_t moment, const InputDirection& d, ViewTangent& seen);
  [[nodiscard]] double reward(std::size_t action, const ViewTangent& seen);

  TaskRollout& rollout_;
  const Task& task_;
  Tangent tangent_;
  Readout readout_;
  std::vector<ActionRecord> records_;
  std::vector<BlockTape> tapes_;
  StateTangent state_;
  std::vector<double> memory_,
      action_;  // how they change: what begin_action left, the action in hand
};

}  // namespace tangere
