// SPDX-License-Identifier: Apache-2.0
// Gradient of a task's return: takes sixteen episodes forward and back.
#pragma once

#include <vector>

#include "tasks/gradients/action_block.hpp"
#include "tasks/gradients/task_gradient_options.hpp"

namespace tangere {

class ReturnBlock : public ActionBlock {
 public:
  /// `options.actions` is the final number of actions, not 0.
  ReturnBlock(const Task& task, const TaskGradientOptions& options);

  /// Plays up to 16 episodes from number `first` on. Writes results to places `to`, to + 1 … of
  /// `out`, and failures with these places as their numbers.
  void run(std::int64_t first, int episodes, const TaskActions& actions, std::int64_t to,
           TaskGradients& out, std::vector<FailedEnvironment>& failures);

  static double bytes(const Task& task, const TaskGradientOptions& options);

 private:
  bool begin_stretch(std::int64_t action) override;
  void take_steps(std::int64_t action, BlockTape* tape) override;
  void reverse(std::int64_t action, const BlockTape& tape) override;
  void note(std::int64_t action);
  void finish(std::int64_t to, TaskGradients& out);

  TaskGradientOptions options_;
  std::vector<std::vector<double>> by_actions_;  // (actions) of (16, action)
  std::vector<double> ones_;                     // (16) derivatives by rewards
  const TaskActions* choose_ = nullptr;          // set during run()
  std::vector<FailedEnvironment> failures_;      // by lane
  std::vector<bool> solved_;                     // (16) in the last action
};

}  // namespace tangere
