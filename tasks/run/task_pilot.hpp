// SPDX-License-Identifier: Apache-2.0
// Drives a rollout as a policy plays a task: one episode in every environment, step by step, for
// files of trajectories.
#pragma once

#include <memory>

#include "tasks/run/policy.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere {

class TaskPilot : public RolloutDriver {
 public:
  /// Starts episode e in every environment e of the batch. Task, policy and batch must outlive it.
  TaskPilot(const Task& task, const Policy& policy, Batch& batch, Precision precision);
  ~TaskPilot() override;

  void drive(std::int64_t step, Batch& batch, std::span<double> u) override;
  /// After the last step of an action: an ActionRow. An environment whose episode is over is held
  /// from then on.
  void done(std::int64_t step, Batch& batch, RowSink& sink) override;

  /// Simulation steps of a whole episode, an opening included.
  static std::int64_t steps(const TaskSpec& spec);
  [[nodiscard]] std::int64_t successes() const;
  [[nodiscard]] double mean_return() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
