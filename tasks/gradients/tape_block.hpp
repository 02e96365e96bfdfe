// SPDX-License-Identifier: Apache-2.0
// One block of a TaskTape: up to sixteen episodes whose actions, and the derivatives by what they
// lead to, come from outside.
#pragma once

#include <array>
#include <vector>

#include "tasks/gradients/action_block.hpp"
#include "tasks/gradients/task_tape_options.hpp"

namespace tangere {

class TapeBlock : public ActionBlock {
 public:
  /// `lanes`: its environments, at most 16.
  TapeBlock(const ActionTapes& tapes, Precision precision, bool parameters, int lanes);

  /// Resets: lane l plays episode first + l.
  void start(std::uint64_t seed, std::int64_t first);
  void displace(int lane, std::span<const double> q, std::span<const double> v);
  /// Takes `actions`, (lanes, action), in the lanes whose episodes go on.
  void step(std::span<const double> actions);
  /// Whether a lane took the last action.
  [[nodiscard]] bool took(int lane) const { return took_[static_cast<std::size_t>(lane)]; }

  void begin_reverse();
  /// Reverses action number `action`. All spans hold the block's lanes, in their order.
  void reverse(std::int64_t action, std::span<const double> by_observation,
               std::span<const double> by_reward, const StateCotangents& by_state,
               std::span<double> by_action);
  void reverse_reset(std::span<const double> by_observation, const StateCotangents& by_state,
                     std::span<double> by_q, std::span<double> by_v,
                     std::span<double> by_parameter);

  [[nodiscard]] const TaskRollout& rollout() const { return rollout_; }
  [[nodiscard]] int lanes() const { return lanes_; }
  /// Numbers of the scene by which there are derivatives.
  [[nodiscard]] int numbers() const { return parameters_.count(); }

 private:
  bool begin_stretch(std::int64_t) override { return false; }  // run() is not used
  void reverse(std::int64_t action, const BlockTape& tape) override;
  void expect(std::span<const double> by_observation, const StateCotangents& by_state);
  void forget(const std::array<bool, kernels::kBlock>& lanes);
  void show_start();

  int lanes_;
  std::array<bool, kernels::kBlock> took_{};
  std::array<ShearState, kernels::kBlock> start_memory_;  // what friction remembered at the reset
  /// What the task saw of an opening before its last moment: (moments, 16, width) each.
  std::vector<double> seen_q_, seen_v_, seen_end_effectors_, seen_tactile_;
  /// Derivatives by what a lane shows since its last action that is not reversed yet. An episode
  /// that has ended goes on showing its last state.
  std::vector<double> shown_, shown_q_, shown_v_;  // (16, observation), (16, nv), (16, nv)
  std::vector<double> by_reward_;                  // (16)
};

}  // namespace tangere
