// SPDX-License-Identifier: Apache-2.0
// How the state of a row hangs on the state and the action of the row before: Jacobians of steps,
// chained over a row.
#pragma once

#include <span>
#include <vector>

#include "engine/derivative/step_jacobian.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

/// Row-major, of one environment. Rows: displacement and velocity after the row, (2 nv).
struct RowJacobian {
  std::vector<double> state;  ///< (2 nv, 2 nv) by the state of the row before
  std::vector<double>
      previous;  ///< (2 nv, 2 nv) by the state one step before that: not zero under BDF2 alone
  std::vector<double> others;  ///< (2 nv, n) by what else the controls hang on
};

/// Chains the steps of a row of one environment.
class RowChain {
 public:
  /// `others`: numbers that controls may hang on besides the state where the row begins.
  RowChain(int nv, std::size_t others);
  void begin();
  /// `controls`: (nu, 2 nv + others), how the step's controls hang on the row's first state and on
  /// the others.
  void add(const StepJacobian& step, std::span<const double> controls);
  void get(RowJacobian& out) const;

 private:
  std::size_t state_, others_, columns_;
  std::vector<double> now_, before_, next_;  // (2 nv, columns)
};

/// Of an action of a task, from where it was chosen: through what the task keeps, its restart, its
/// controls and steps.
class ActionJacobians {
 public:
  ActionJacobians(const Task& task, const StepperOptions& options);
  /// Of all lanes of a rollout that has taken the steps of an action, onto `tape`.
  void evaluate(TaskRollout& rollout, const ActionRecord& record, std::int64_t action,
                const BlockTape& tape);
  /// `others`: the action, 0 for numbers beyond their bounds. Of a lane that did not take it: the
  /// state stays.
  [[nodiscard]] const RowJacobian& of(int lane) const { return rows_[std::size_t(lane)]; }

 private:
  void ask(TaskRollout& rollout, const ActionRecord& record, std::int64_t action, int step,
           const BlockTape& tape, int lane);
  void compose(TaskRollout& rollout, const ActionRecord& record, std::int64_t action, int lane);

  const Task& task_;
  StepJacobians steps_;
  std::size_t state_, width_, memory_;
  std::vector<RowChain> chains_;               // (16)
  std::vector<std::vector<double>> controls_;  // (16) of (nu, 2 nv + action + memory)
  std::vector<RowJacobian> rows_;              // (16)
};

}  // namespace tangere
