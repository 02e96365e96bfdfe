// SPDX-License-Identifier: Apache-2.0
// Interface of an episode: start of a block of 16, controls of each step, snapshots, and result of
// a row. There is one implementation for scenes and one for tasks. The code that runs episodes
// (rollouts, data sets, benchmarks) depends on this interface alone.
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
struct StepTally;

/// Steps count from the start of the episodes, including their warm-up. Every step calls
/// controls(), steps, and calls after_step(). After the last step of the warm-up and of each row, after_row()
/// follows. Different blocks of a batch may be in different threads, each with a program of its
/// own.
class EpisodeProgram {
 public:
  virtual ~EpisodeProgram() = default;
  [[nodiscard]] virtual int steps_per_row() const = 0;
  /// Steps before the first row.
  [[nodiscard]] virtual int opening_steps() const { return 0; }

  /// Starts the block, for which the batch has drawn the episodes.
  virtual void start(Batch& /*batch*/, int /*block*/) {}
  /// Writes the controls of the block's environments into u, (E, nu), which holds those of the step
  /// before.
  virtual void controls(std::int64_t step, Batch& batch, int block, std::span<double> u) = 0;
  virtual void after_step(std::int64_t /*step*/, const Batch& /*batch*/, int /*block*/) {}
  virtual void after_row(Batch& /*batch*/, int /*block*/) {}
  /// Returns the task program whose rows have actions, rewards and an end. Null for a scene: its
  /// controls are its actions, its reward is 0, and its episodes last as long as requested.
  [[nodiscard]] virtual TaskProgram* task_program() { return nullptr; }
  /// Returns the counts of all steps so far. A task counts itself, and leaves out steps that fail.
  /// A scene's are those of the player's tally: each step is an action.
  [[nodiscard]] virtual VectorCounts counts(const StepTally& tally) const;
};

/// Writes the controls of a step of a scene into u, (E, nu), for the environments of a block.
void write_controls(const ControlProgram& controls, std::int64_t step, const Batch& batch,
                    int block, std::span<double> u);
/// Does the same for all blocks.
void write_controls(const ControlProgram& controls, std::int64_t step, const Batch& batch,
                    std::span<double> u);

/// The program of a scene, driven by its controls or a table.
class SceneProgram : public EpisodeProgram {
 public:
  /// `first_step`: the step of the controls that step 0 uses. A row holds the controls of its first
  /// step. `controls` must outlive this object.
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

/// The program of a task, played by a policy. A row is an action.
class TaskProgram : public EpisodeProgram {
 public:
  enum class AtEnd {
    hold,   ///< an environment whose episode has ended keeps its last state
    again,  ///< it starts another one, as in a VectorTask
  };
  /// Plays the environments of `data`, which programs of several threads may share. `in_turn`: the
  /// number of blocks that take a step before any of them takes the next. Task and policy must
  /// outlive this object.
  TaskProgram(const Task& task, const Policy& policy, std::shared_ptr<EnvironmentData> data,
              Precision precision, int in_turn = 1, AtEnd at_end = AtEnd::hold);

  [[nodiscard]] int steps_per_row() const override { return task_.spec().steps_per_action; }
  [[nodiscard]] int opening_steps() const override {
    return task_.spec().warm_up ? task_.spec().steps_per_action : 0;
  }
  void start(Batch& batch, int block) override;
  void controls(std::int64_t step, Batch& batch, int block, std::span<double> u) override;
  void after_step(std::int64_t step, const Batch& batch, int block) override;
  void after_row(Batch& batch, int block) override;
  [[nodiscard]] TaskProgram* task_program() override { return this; }

  [[nodiscard]] const Task& task() const { return task_; }
  [[nodiscard]] const Policy& policy() const { return policy_; }
  [[nodiscard]] const EnvironmentData& data() const { return *data_; }
  /// Counts over all blocks so far.
  [[nodiscard]] const VectorCounts& counts() const { return counts_; }
  [[nodiscard]] VectorCounts counts(const StepTally& /*tally*/) const override { return counts_; }
  void clear_counts() { counts_ = {}; }

  /// Simulation steps of a whole episode, warm-up included.
  static std::int64_t steps(const TaskSpec& spec);

 private:
  [[nodiscard]] BlockWorker& worker(int block) {
    return workers_[static_cast<std::size_t>(block) % workers_.size()];
  }
  void choose(const Batch& batch, int block);
  void choose_together(const Batch& batch, int block);

  const Task& task_;
  const Policy& policy_;
  std::shared_ptr<EnvironmentData> data_;
  std::vector<BlockWorker> workers_;   // each with the last snapshots of its block
  std::vector<double> actions_;        // (E, action)
  std::vector<double> seen_, chosen_;  // (16, observation), (16, action) for one question
  AtEnd at_end_;
  VectorCounts counts_;
};

}  // namespace tangere
