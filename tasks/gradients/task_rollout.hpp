// SPDX-License-Identifier: Apache-2.0
// Up to sixteen episodes side by side, an action at a time, with what their derivatives need to
// know of it.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "engine/step/tape.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/block_worker.hpp"

namespace tangere {

/// Fills the action of an episode that shows `view` and `observation`. Called from several threads.
using TaskActions = std::function<void(const TaskView& view, std::span<const double> observation,
                                       std::span<double> action)>;

/// An action as it began, of every lane.
struct ActionRecord {
  std::vector<double> q, v;  ///< (16, nq), (16, nv) where it was chosen: before a task restarts
  std::vector<double> found, memory;          ///< (16, memory) before and after begin_action
  std::vector<double> asked, action;          ///< (16, action): as chosen, as taken
  std::array<bool, kernels::kBlock> taken{};  ///< false: the episode had ended

  explicit ActionRecord(const Task& task);
  static double bytes(const Task& task);
};

/// Owns the scratch of one thread. The steps are those of a VectorTask, bit for bit.
class TaskRollout {
 public:
  TaskRollout(const Task& task, const StepperOptions& options, Precision precision);

  /// Resets so many episodes, their openings included: what comes next is their first action.
  void start(std::uint64_t seed, std::span<const std::int64_t> episodes);
  /// Starts a lane's first action from another state; what a scheme of two steps remembers stays.
  void displace(int lane, std::span<const double> q, std::span<const double> v);

  [[nodiscard]] bool running() const;  ///< whether some episode goes on
  /// Chooses the next action of who is running, into record.asked. Throws InputError for one that
  /// is not finite.
  void choose(const TaskActions& actions, ActionRecord& record);
  /// Begins record.asked and fills in the rest.
  void begin(ActionRecord& record);
  /// Its steps; `tape`, if any, is begun anew.
  void take_steps(BlockTape* tape);
  /// Rewards, and who has ended.
  void conclude();
  /// The steps of an action again, from the state that it began with.
  void retake_steps(const ActionRecord& record, std::int64_t action, BlockTape& tape);
  /// Puts a lane where a task restarts.
  void place_again(const ActionRecord& record, std::int64_t action);
  /// Controls for the steps of an action from `step` on into u(), of lanes that took it; the
  /// action's first state is at 0 of `tape`.
  void ask_again(const ActionRecord& record, std::int64_t action, int step, const BlockTape& tape);
  /// What was seen during an action: on its tape again.
  void look_again(const BlockTape& tape);

  [[nodiscard]] const Task& task() const { return task_; }
  [[nodiscard]] const Batch& batch() const { return *batch_; }
  [[nodiscard]] Batch& batch() { return *batch_; }
  [[nodiscard]] const EnvironmentData& data() const { return *data_; }
  [[nodiscard]] int lanes() const { return batch_->environments(); }
  [[nodiscard]] std::span<const double> u() const { return u_; }
  [[nodiscard]] std::span<const Moment> moments(int lane) const { return worker_.moments(lane); }
  [[nodiscard]] Integrator integrator() const { return stepper_.integrator(); }
  [[nodiscard]] const VectorCounts& counts() const { return counts_; }

  /// What the task saw when it took action number `action`, of which `memory` and `now` are given.
  [[nodiscard]] TaskView view(const ActionRecord& record, std::int64_t action, int lane,
                              std::span<const double> memory, std::span<const Moment> now) const;
  /// A lane's first state of an action, from its tape.
  [[nodiscard]] Moment first_moment(const BlockTape& tape, int lane);

 private:
  const Task& task_;
  BlockWorker worker_;
  Stepper stepper_;
  std::optional<Batch> batch_;
  std::optional<EnvironmentData> data_;
  VectorCounts counts_, recounted_;
  std::vector<double> u_;      // (16, nu) of ask_again
  std::vector<double> q_, v_;  // (nq), (nv) of first_moment
};

}  // namespace tangere
