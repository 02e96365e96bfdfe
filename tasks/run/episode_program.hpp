// SPDX-License-Identifier: Apache-2.0
// An episode as a program: how a block of 16 starts, which controls each step takes, what is looked
// at and how a row is judged. A scene and a task are its two makers; whoever plays episodes (the
// rollout, the player of data sets, the benchmark) knows nothing else of them.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/step/control.hpp"
#include "tasks/run/block_worker.hpp"
#include "tasks/run/policy.hpp"

namespace tangere {

class TaskProgram;

/// Steps are counted from the start of the episodes, their opening included. For every step:
/// controls(), the step, look(); after the last step of the opening and of each row: judge().
/// Different blocks of a batch may be in different threads, each with a program of its own.
class EpisodeProgram {
 public:
  virtual ~EpisodeProgram() = default;
  [[nodiscard]] virtual int steps_per_row() const = 0;
  /// Steps before the first row.
  [[nodiscard]] virtual int opening_steps() const { return 0; }

  /// The batch has drawn the episodes of the block.
  virtual void start(Batch& /*batch*/, int /*block*/) {}
  /// Controls of the block's environments into u, (E, nu), which holds those of the step before.
  virtual void controls(std::int64_t step, Batch& batch, int block, std::span<double> u) = 0;
  virtual void look(std::int64_t /*step*/, const Batch& /*batch*/, int /*block*/) {}
  virtual void judge(Batch& /*batch*/, int /*block*/) {}
  /// Whose rows have actions, rewards and an end of their own; null: a scene, whose controls are
  /// its actions, whose reward is 0 and whose episodes last as long as asked for.
  [[nodiscard]] virtual TaskProgram* judged() { return nullptr; }
};

/// A scene's, driven by its controls or a table.
class SceneProgram : public EpisodeProgram {
 public:
  /// `first_step`: that of the controls which step 0 takes. Those of a row's first step are held
  /// for all of it. `controls` must outlive it.
  explicit SceneProgram(const ControlProgram& controls, int steps_per_row = 1,
                        std::int64_t first_step = 0)
      : controls_(controls), steps_per_row_(steps_per_row), first_step_(first_step) {}

  [[nodiscard]] int steps_per_row() const override { return steps_per_row_; }
  void controls(std::int64_t step, Batch& batch, int block, std::span<double> u) override;

 private:
  const ControlProgram& controls_;
  int steps_per_row_;
  std::int64_t first_step_;
};

/// A task's, played by a policy: a row is an action.
class TaskProgram : public EpisodeProgram {
 public:
  enum class AtEnd {
    hold,   ///< an environment whose episode is over keeps its last state
    again,  ///< it starts another one, as those of a VectorTask do
  };
  /// Of the environments of `data`, which programs of several threads may share. `in_turn`: so many
  /// blocks are taken through a step before any of them through the next. Task and policy must
  /// outlive it.
  TaskProgram(const Task& task, const Policy& policy, std::shared_ptr<EnvironmentData> data,
              Precision precision, int in_turn = 1, AtEnd at_end = AtEnd::hold);

  [[nodiscard]] int steps_per_row() const override { return task_.spec().steps_per_action; }
  [[nodiscard]] int opening_steps() const override {
    return task_.spec().opening ? task_.spec().steps_per_action : 0;
  }
  void start(Batch& batch, int block) override;
  void controls(std::int64_t step, Batch& batch, int block, std::span<double> u) override;
  void look(std::int64_t step, const Batch& batch, int block) override;
  void judge(Batch& batch, int block) override;
  [[nodiscard]] TaskProgram* judged() override { return this; }

  [[nodiscard]] const Task& task() const { return task_; }
  [[nodiscard]] const EnvironmentData& data() const { return *data_; }
  /// Of all blocks until now.
  [[nodiscard]] const VectorCounts& counts() const { return counts_; }
  void clear_counts() { counts_ = {}; }

  /// Simulation steps of a whole episode, an opening included.
  static std::int64_t steps(const TaskSpec& spec);

 private:
  [[nodiscard]] BlockWorker& worker(int block) {
    return workers_[static_cast<std::size_t>(block) % workers_.size()];
  }
  void choose(const Batch& batch, int block);

  const Task& task_;
  const Policy& policy_;
  std::shared_ptr<EnvironmentData> data_;
  std::vector<BlockWorker> workers_;  // what each saw last of its block is in it
  std::vector<double> actions_;       // (E, action)
  AtEnd at_end_;
  VectorCounts counts_;
};

}  // namespace tangere
