// SPDX-License-Identifier: Apache-2.0
// Takes sixteen episodes of a task forward onto tapes and back, action by action, through rewards,
// observations, steps, controls, restarts and memory. Derived classes choose the actions and say
// what the derivatives enter by: a return (return_block.hpp), or what a caller brings from outside
// (tape_block.hpp).
#pragma once

#include <vector>

#include "tasks/gradients/gradient_block.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

/// The tapes of a number of blocks of episodes.
struct ActionTapes {
  const Task& task;
  StepperOptions stepper;
  std::int64_t actions;  ///< of an episode, at most; the final number
  std::int64_t blocks;   ///< that hold tapes at once
  double bytes;          ///< limit for the tapes of all these blocks
};
/// Throws InputError when not even checkpoints fit.
TapePlan plan_of(const ActionTapes& tapes);
/// What they take, checkpoints included [bytes].
double bytes_of(const ActionTapes& tapes);

/// Derivatives of a loss by what follows an action, for every lane.
struct AfterAction {
  std::span<const double> reward;       ///< (16)
  std::span<const double> observation;  ///< (16, observation), or empty: zeros
  std::span<const double> q, v;         ///< (16, nv) by the state after it, or empty: zeros
};

class ActionBlock : public GradientBlock {
 public:
  /// Scratch beside the tapes [bytes].
  static double workspace_bytes(const Task& task);

 protected:
  ActionBlock(const ActionTapes& tapes, Precision precision, bool parameters);

  /// Resets one episode per lane.
  void start(std::uint64_t seed, std::span<const std::int64_t> episodes);
  void take_steps(std::int64_t action, BlockTape* tape) override;
  void retake_steps(std::int64_t action, bool from_checkpoint, BlockTape& tape) override;
  /// Moves the adjoint's cotangents and by_memory_ from the state after an action to the state in
  /// which the action was chosen, and sets by_action_. Lanes that did not take it keep theirs.
  void reverse_action(std::int64_t action, const BlockTape& tape, const AfterAction& after);

  // The parts that a reset needs too.
  void clear_moments();
  void add_seen(const TaskView& view, int lane, const AfterAction& after, const ViewCotangent& to);
  void add_moment(std::size_t moment);
  /// A lane's cotangents of all moments, until the next call.
  [[nodiscard]] std::span<const SnapshotCotangent> cotangents(int lane);

  /// A lane's part of rows by lane.
  [[nodiscard]] static std::span<double> part(std::vector<double>& all, int lane);
  [[nodiscard]] static std::span<const double> part(const std::vector<double>& all, int lane);

  const Task& task_;
  TaskRollout rollout_;
  std::vector<ActionRecord> records_;  // (actions)
  std::vector<double> by_action_;      // (16, action) cotangents of the action reversed last
  std::vector<double> by_memory_;      // (16, memory) cotangents of the memory after begin_action

 private:
  void reverse_judgement(const ActionRecord& r, std::int64_t action, const AfterAction& after);
  void add_fields(std::size_t moment, int lane);
  void reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                        const BlockTape& tape);
  void reverse_start(const ActionRecord& r, std::int64_t action);

  struct MomentRows {
    std::vector<double> q, v, end_effectors, tactile;  // (16, width)
  };
  std::vector<MomentRows> moments_;  // cotangents of an action's moments
  std::vector<SnapshotCotangent> to_moments_;
  std::vector<double> start_q_, start_v_;  // (16, nv) cotangents of its first state
  std::vector<double> by_u_;               // (16, nu) cotangents of the current controls
};

}  // namespace tangere
