// SPDX-License-Identifier: Apache-2.0
// Sixteen episodes of a task forward onto tapes and back: through rewards, steps, controls,
// restarts and memory, action by action.
#pragma once

#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "tasks/gradients/task_gradients.hpp"

namespace tangere {

/// Scratch of one thread.
class TaskGradientBlock {
 public:
  /// `options.actions` is the number there are.
  TaskGradientBlock(const Task& task, const TaskGradientOptions& options);

  /// Up to 16 episodes from number `first` on. Results go to places `to`, to + 1 … of `out`.
  void run(std::int64_t first, int episodes, const TaskActions& actions, std::int64_t to,
           TaskGradients& out, std::vector<LostEpisode>& lost);

  /// Counts from 0; `go_on` (empty: always) must outlive the runs that follow.
  void begin(const GradientGoOn& go_on);
  [[nodiscard]] bool stopped() const { return stopped_; }
  [[nodiscard]] std::int64_t recomputed_steps() const { return recomputed_steps_; }
  static double bytes(const Task& task, const TaskGradientOptions& options);

 private:
  [[nodiscard]] bool may_go_on();
  void forward(const TaskActions& actions, std::vector<LostEpisode>& lost);
  void backward();
  void reverse(std::int64_t action, const BlockTape& tape);
  void reverse_rewards(const ActionRecord& r, std::int64_t action);
  void add_moment(std::size_t moment, const BlockTape& tape);
  void add_fields(std::size_t moment, int lane);
  void reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                        const BlockTape& tape);
  void reverse_start(const ActionRecord& r, std::int64_t action);
  void finish(std::int64_t to, TaskGradients& out);

  /// A cotangent's part of a lane.
  [[nodiscard]] std::span<double> part(std::vector<double>& all, int lane) const;
  [[nodiscard]] std::span<const double> part(const std::vector<double>& all, int lane) const;
  [[nodiscard]] MomentCotangent cotangent(std::size_t moment, int lane);

  const Task& task_;
  TaskGradientOptions options_;
  TaskRollout rollout_;
  Adjoint adjoint_;
  ReadoutPullback pullback_;
  NumberGradients parameters_;
  std::int64_t segment_;          // actions on tapes at a time
  std::int64_t taken_ = 0;        // actions of the episode that is longest
  std::vector<BlockTape> tapes_;  // (segment)
  std::vector<BlockState> checkpoints_;
  std::vector<ActionRecord> records_;  // (actions)
  struct MomentRows {
    std::vector<double> q, v, end_effectors, tactile;  // (16, width)
  };
  std::vector<MomentRows> moments_;             // cotangents of an action's moments
  std::vector<double> start_q_, start_v_;       // (16, nv) of its first state
  std::vector<double> by_u_;                    // (16, nu) of the controls in hand
  std::vector<double> by_memory_;               // (16, memory), of the memory after begin_action
  std::vector<std::vector<double>> by_action_;  // (actions) of (16, action)
  const GradientGoOn* go_on_ = nullptr;
  bool stopped_ = false;
  std::int64_t recomputed_steps_ = 0;
};

}  // namespace tangere
