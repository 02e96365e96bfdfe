// SPDX-License-Identifier: Apache-2.0
// Gradient of a task's return: takes sixteen episodes forward onto tapes and back, through rewards,
// steps, controls, restarts and memory, action by action.
#pragma once

#include <vector>

#include "tasks/gradients/gradient_block.hpp"
#include "tasks/gradients/task_gradients.hpp"

namespace tangere {

class ReturnBlock : public GradientBlock {
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
  void retake_steps(std::int64_t action, bool from_checkpoint, BlockTape& tape) override;
  void reverse(std::int64_t action, const BlockTape& tape) override;
  void reverse_rewards(const ActionRecord& r, std::int64_t action);
  void add_moment(std::size_t moment, const BlockTape& tape);
  void add_fields(std::size_t moment, int lane);
  void reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                        const BlockTape& tape);
  void reverse_start(const ActionRecord& r, std::int64_t action);
  void note(std::int64_t action);
  void finish(std::int64_t to, TaskGradients& out);

  /// A lane's part of a cotangent.
  [[nodiscard]] std::span<double> part(std::vector<double>& all, int lane) const;
  [[nodiscard]] std::span<const double> part(const std::vector<double>& all, int lane) const;
  [[nodiscard]] MomentCotangent cotangent(std::size_t moment, int lane);

  const Task& task_;
  TaskGradientOptions options_;
  TaskRollout rollout_;
  std::vector<ActionRecord> records_;  // (actions)
  struct MomentRows {
    std::vector<double> q, v, end_effectors, tactile;  // (16, width)
  };
  std::vector<MomentRows> moments_;        // cotangents of an action's moments
  std::vector<double> start_q_, start_v_;  // (16, nv) cotangents of its first state
  std::vector<double> by_u_;               // (16, nu) cotangents of the current controls
  std::vector<double> by_memory_;  // (16, memory) cotangents of the memory after begin_action
  std::vector<std::vector<double>> by_action_;  // (actions) of (16, action)
  const TaskActions* choose_ = nullptr;         // set during run()
  std::vector<FailedEnvironment> lost_;         // by lane
  std::vector<bool> sound_;                     // (16)
};

}  // namespace tangere
