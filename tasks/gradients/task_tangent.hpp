// SPDX-License-Identifier: Apache-2.0
// How an episode changes along a direction, computed forward and action by action: the second route
// by which gradients of returns and of closed loops are checked. The reverse function of a task
// gives one row of its derivative at a time, and the tangent is all rows times the change. Steps
// run in dual numbers.
#pragma once

#include <span>
#include <vector>

#include "engine/derivative/tangent.hpp"
#include "tasks/gradients/gradient_compare.hpp"
#include "tasks/gradients/row_jacobians.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

/// Tangent of a TaskView, in its order. That of q is along the dofs.
struct ViewTangent {
  std::vector<std::vector<double>> q, v, end_effectors, tactile;  ///< per snapshot
  std::vector<double> memory, action;
};

/// One episode. Slow: a task's functions are called once for each number that they fill.
class TaskTangent {
 public:
  /// Plays lane 0 of `rollout`, which has just started, with `actions`: (A, action), within their
  /// bounds.
  TaskTangent(TaskRollout& rollout, std::span<const double> actions, const StepperOptions& options);

  /// Restarts with tangents of the state at the first action, (nv) each; an empty span: zeros.
  void start(std::span<const double> q, std::span<const double> v);
  /// Returns the view at the reset, after start(), and its tangent; valid until the next call. Its
  /// one snapshot is the state at the first action. For a task that does not restart. `numbers`: as
  /// in take().
  ViewTangent seen_at_start(std::span<const double> numbers);
  [[nodiscard]] TaskView start_view();
  /// Takes the next action, with tangent `change` of its numbers and `numbers` of the scene's
  /// parameters (rows as in BlockCotangent::parameters, or empty). Returns the tangent of its
  /// reward.
  double take(std::span<const double> change, std::span<const double> numbers);
  /// Tangent of the view of the last action.
  [[nodiscard]] const ViewTangent& seen() const { return seen_; }
  [[nodiscard]] TaskView view() const;

  /// How the return changes.
  [[nodiscard]] double along(const InputDirection& direction);

 private:
  struct OwnCotangent;
  void begin(std::size_t action);
  void take_steps(std::size_t action, std::span<const double> numbers);
  void read_snapshot(const BlockTape& tape, int step, std::size_t moment,
                     std::span<const double> numbers, ViewTangent& seen);
  [[nodiscard]] double reward(std::size_t action) const;
  [[nodiscard]] TaskView view_of_action(std::size_t action, const std::vector<double>& memory,
                                        const Snapshot& first) const;
  [[nodiscard]] std::vector<double> times(const std::vector<double>& rows,
                                          const StateTangent& start) const;
  [[nodiscard]] ViewTangent unseen(std::size_t moments) const;

  TaskRollout& rollout_;
  const Task& task_;
  Tangent tangent_;
  std::vector<ActionRecord> records_;
  std::vector<BlockTape> tapes_;
  std::size_t taken_ = 0;
  StateTangent state_;
  ViewTangent seen_;
  std::vector<double> memory_,
      action_;  // tangents of the task state after begin_action, and of the action
};

}  // namespace tangere
