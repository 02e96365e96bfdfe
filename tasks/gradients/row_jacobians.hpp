// SPDX-License-Identifier: Apache-2.0
// Computes how the state of a row depends on the state and the action of the row before, by
// chaining Jacobians of steps over a row.
#pragma once

#include <span>
#include <vector>

#include "engine/derivative/step_jacobian.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

/// Row-major, for one environment. Rows: displacement and velocity after the row, (2 nv).
struct RowJacobian {
  std::vector<double> state;  ///< (2 nv, 2 nv) by the state of the row before
  std::vector<double>
      previous;  ///< (2 nv, 2 nv) by the state one step before that; nonzero only for BDF2
  std::vector<double> others;  ///< (2 nv, n) by the other numbers that the controls depend on
};

/// Chains the steps of a row of one environment.
class RowChain {
 public:
  /// `others`: how many numbers controls may depend on besides the state where the row begins.
  RowChain(int nv, std::size_t others);
  void begin();
  /// `controls`: (nu, 2 nv + others), derivatives of the step's controls by the row's first state
  /// and by the others.
  void add(const StepJacobian& step, std::span<const double> controls);
  void get(RowJacobian& out) const;

 private:
  std::size_t state_, others_, columns_;
  std::vector<double> now_, before_, next_;  // (2 nv, columns)
};

/// Jacobians at the start of an action, one row per output, by (q, v, action, task state) of
/// `view`: of the controls from `step` on, of the state after a restart, and of the task state
/// after begin_action.
std::vector<double> control_rows(const Task& task, const TaskView& view, int step);
std::vector<double> restart_rows(const Task& task, const TaskView& view);
std::vector<double> memory_rows(const Task& task, const TaskView& view);

/// Jacobian of an action of a task from the state in which it was chosen, through the update of the
/// task state, the restart, the controls and the steps.
class ActionJacobians {
 public:
  ActionJacobians(const Task& task, const StepperOptions& options);
  /// Evaluates all lanes of a rollout that has taken the steps of an action onto `tape`.
  void evaluate(TaskRollout& rollout, const ActionRecord& record, std::int64_t action,
                const BlockTape& tape);
  /// Here `others` is the action, with 0 for components beyond their bounds. For a lane that did
  /// not take the action, the state stays.
  [[nodiscard]] const RowJacobian& of(int lane) const { return rows_[std::size_t(lane)]; }

 private:
  void compose(TaskRollout& rollout, const ActionRecord& record, std::int64_t action, int lane);

  const Task& task_;
  StepJacobians steps_;
  std::size_t state_, width_, memory_;
  std::vector<RowChain> chains_;               // (16)
  std::vector<std::vector<double>> controls_;  // (16) of (nu, 2 nv + action + task state)
  std::vector<RowJacobian> rows_;              // (16)
};

}  // namespace tangere
