// SPDX-License-Identifier: Apache-2.0
// Plays up to sixteen episodes side by side, an action at a time, and records what their
// derivatives need.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "engine/step/tape.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/gradients/tape_options.hpp"
#include "tasks/run/block_worker.hpp"

namespace tangere {

/// The start of an action, for every lane.
struct ActionRecord {
  std::vector<double> q, v;  ///< (16, nq), (16, nv) when it was chosen, before a task restarts
  std::vector<double> found, task_state;      ///< (16, task state) before and after begin_action
  std::vector<double> chosen, action;         ///< (16, action): as chosen, as taken
  std::array<bool, kernels::kBlock> taken{};  ///< false: the episode had ended
  /// (lanes, <randomize>) values that it brings; empty: those before it
  std::vector<double> varying;

  explicit ActionRecord(const Task& task);
  static double bytes(const Task& task);
};

/// The steps are those of a VectorTask, bit for bit.
class TaskRollout {
 public:
  TaskRollout(const Task& task, const StepperOptions& options, Precision precision);

  /// Resets one episode per lane, openings included. The first action comes next.
  void start(std::uint64_t seed, std::span<const std::int64_t> episodes);
  /// Starts a lane's first action from another state. The history of a scheme of two steps stays.
  void displace(int lane, std::span<const double> q, std::span<const double> v);
  /// Values of the scene's <randomize>, (lanes, their count); states have no effect.
  [[nodiscard]] std::vector<double> varying() const;
  void set_varying(std::span<const double> values);
  /// Records snapshots of the present states of the batch, in which the first actions begin.
  void record_start();
  /// The view at the reset of a lane, valid until the first action begins.
  [[nodiscard]] TaskView start_view(int lane) const;
  /// Observes a lane's reset again.
  void observe_start(int lane);

  [[nodiscard]] bool running() const;  ///< whether some episode has not ended
  /// Computes the next action of every running lane, stored in `record`. Throws InputError for one
  /// that is not finite.
  void choose(const TaskActions& actions, ActionRecord& record);
  /// Begins record.requested and fills in the rest of the record.
  void begin(ActionRecord& record);
  /// Takes the steps of the action. Clears `tape`, if any, and records them on it.
  void take_steps(BlockTape* tape);
  /// Evaluates rewards and finds which lanes have ended.
  void conclude();
  /// Takes the steps of an action again, from the state in which it began.
  void retake_steps(const ActionRecord& record, std::int64_t action, BlockTape& tape);
  /// Restarts a lane again as the task did.
  void recompute_restart(const ActionRecord& record, std::int64_t action);
  /// Fills u() with the controls for the steps of an action from `step` on, for lanes that took it.
  /// The action's first state is entry 0 of `tape`.
  void recompute_controls(const ActionRecord& record, std::int64_t action, int step,
                          const BlockTape& tape);
  /// Recomputes the snapshots of the action on `tape`.
  void recompute_snapshots(const BlockTape& tape);

  [[nodiscard]] const Task& task() const { return task_; }
  [[nodiscard]] const Batch& batch() const { return *batch_; }
  [[nodiscard]] Batch& batch() { return *batch_; }
  [[nodiscard]] const EnvironmentData& data() const { return *data_; }
  [[nodiscard]] int lanes() const { return batch_->environments(); }
  [[nodiscard]] std::span<const double> u() const { return u_; }
  [[nodiscard]] std::span<const Snapshot> snapshots(int lane) const {
    return worker_.snapshots(lane);
  }
  [[nodiscard]] Integrator integrator() const { return integrator_; }
  /// Steps with a stepper of the caller from now on: made for the same model and options, used by
  /// no other thread at the same time. So many rollouts share the scratch of a thread.
  void use(Stepper& stepper) { shared_ = &stepper; }
  [[nodiscard]] const VectorCounts& counts() const { return counts_; }

  /// The view in which action number `action` was taken. The caller gives task state and snapshots.
  [[nodiscard]] TaskView view(const ActionRecord& record, std::int64_t action, int lane,
                              std::span<const double> memory, std::span<const Snapshot> now) const;
  /// A lane's first state of an action, from its tape.
  [[nodiscard]] Snapshot first_moment(const BlockTape& tape, int lane);

 private:
  [[nodiscard]] Stepper& stepper();

  const Task& task_;
  BlockWorker worker_;
  StepperOptions options_;
  Integrator integrator_;
  std::unique_ptr<Stepper> own_;  // made when needed
  Stepper* shared_ = nullptr;
  std::optional<Batch> batch_;
  std::optional<EnvironmentData> data_;
  VectorCounts counts_, recounted_;
  std::vector<double> u_;      // (16, nu) written by recompute_controls
  std::vector<double> q_, v_;  // (nq), (nv) written by first_moment
};

}  // namespace tangere
