// SPDX-License-Identifier: Apache-2.0
// Tape of up to sixteen episodes of a task, one action after the other. Pulls cotangents of
// rewards, observations and states back through steps, controls, restarts and the task state to
// actions. For a return, the cotangent of each reward is 1.
#pragma once

#include <array>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "tasks/gradients/tape_block.hpp"
#include "tasks/gradients/task_rollout.hpp"

namespace tangere {

/// Options for a task: with the final number of actions. `what` is for messages.
/// Throws InputError for numbers out of range.
TapeOptions options_for(const Task& task, TapeOptions options, const char* what);

class TaskBlock : public TapeBlock {
 public:
  /// One of `blocks` that hold tapes at once, within options.tape_bytes together. options.length is
  /// the final number of actions. Throws InputError when not even checkpoints fit.
  TaskBlock(const Task& task, const TapeOptions& options, std::int64_t blocks);
  /// Size of all these blocks without steppers [bytes].
  static double bytes(const Task& task, const TapeOptions& options, std::int64_t blocks);

  /// Resets one episode per lane. `record`: whether its actions can be reversed.
  void start(std::uint64_t seed, EpisodeRange episodes, bool record = true);
  /// Moves the states in which the first actions begin, (lanes, nq), (lanes, nv) and, unless empty,
  /// (lanes, points, 3) shear states.
  void displace(std::span<const double> q, std::span<const double> v,
                std::span<const double> shear_state);
  /// Takes `actions`, (lanes, action), in the lanes whose episodes have not ended. `varying`: as in
  /// TaskTape::step().
  void step(std::span<const double> actions, std::span<const double> varying);
  /// Whether a lane took the last action.
  [[nodiscard]] bool took(int lane) const { return took_[static_cast<std::size_t>(lane)]; }

  void begin_reverse();
  /// Reverses action number `action` and fills derivatives by it, (lanes, action). All spans hold
  /// the block's lanes, in their order. `parameter_bar`: as in TaskTape::reverse().
  void reverse(std::int64_t action, const ActionCotangents& by, std::span<double> action_bar,
               std::span<double> parameter_bar);
  /// Ends the reverse pass: takes cotangents of the results of the reset, and fills those of the
  /// start. Skips empty spans.
  void reverse_reset(const ActionCotangents& by, const StartCotangents& out);

  /// Plays up to 16 episodes and reverses their returns. Writes results to places `to`, to + 1 … of
  /// `out`, and failures with these places as their numbers.
  void play(std::uint64_t seed, EpisodeRange episodes, const TaskActions& actions, std::int64_t to,
            TaskGradients& out, std::vector<FailedEnvironment>& failures);

  /// As TaskRollout::use().
  void use(Stepper& stepper) { rollout_.use(stepper); }
  [[nodiscard]] const TaskRollout& rollout() const { return rollout_; }
  [[nodiscard]] int lanes() const { return rollout_.lanes(); }

 private:
  /// Rows of lanes: the numbers of one snapshot, or their cotangents.
  struct SnapshotRows {
    std::vector<double> q, v, end_effectors, tactile, bodies, shear_state;  // (16, width)
  };
  void take_steps(std::int64_t action, BlockTape* tape) override;
  void retake_steps(std::int64_t action, bool from_checkpoint, BlockTape& tape) override;
  void reverse_steps(std::int64_t action, const BlockTape& tape) override;
  void take(ActionRecord& record);
  void restore_varying(std::int64_t action);
  void take_parameters(std::span<double> bar);
  void add_to_shown(const ActionCotangents& by);
  void clear_snapshots();
  void reverse_outcome(const ActionRecord& r, std::int64_t action);
  void reverse_observation(const TaskView& view, int lane, const ViewCotangent& to);
  void add_snapshot(std::size_t moment);
  void add_readings(std::size_t moment, int lane);
  void add_shear_state(std::span<const double> bar, int lane);
  void reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                        const BlockTape& tape);
  void reverse_start(const ActionRecord& r, std::int64_t action);
  void add_start_to_shown();
  void finish_return(std::int64_t to, TaskGradients& out);
  /// A lane's cotangents of all snapshots, valid until the next call.
  [[nodiscard]] std::span<const SnapshotCotangent> cotangents(int lane);

  const Task& task_;
  TapeOptions options_;
  TaskRollout rollout_;
  std::vector<ActionRecord> records_;  // (actions)
  std::array<bool, kernels::kBlock> took_{};
  std::array<ShearState, kernels::kBlock> start_shear_;  // shear states at the reset
  ShearStateArrays shear_arrays_;
  std::vector<double> first_varying_;  // (lanes, <randomize>) before an action brought values
  BlockTape start_;                    // states at the reset
  std::vector<SnapshotRows> warm_up_;  // snapshots of a warm-up before its last one
  // Cotangents for the action reversed last: of its snapshots, first state, controls, and itself.
  std::vector<SnapshotRows> snapshots_bar_;
  std::vector<SnapshotCotangent> snapshot_cotangents_;
  std::vector<double> start_q_, start_v_, u_bar_,
      action_bar_;                      // (16, nv), …, (16, nu), (16, action)
  std::vector<double> task_state_bar_;  // (16, task state) after begin_action
  /// Cotangents accumulated for the observations, positions and velocities of a lane after its last
  /// unreversed action. An ended episode repeats its last state.
  std::vector<double> shown_, shown_q_, shown_v_;  // (16, observation), (16, nv), (16, nv)
  std::vector<double> reward_bar_;                 // (16)
};

}  // namespace tangere
