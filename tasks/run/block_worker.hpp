// SPDX-License-Identifier: Apache-2.0
// One thread's part of a VectorTask: takes a block of 16 environments through one action.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/catalogue/task.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere {

enum class EnvironmentState : std::uint8_t {
  to_start,  ///< its next step starts episode `next_episode`
  running,
  over,
};

/// Data of a VectorTask's environments besides their states, (E, width) each. Only one thread uses
/// a block's part.
struct EnvironmentData {
  EnvironmentData(const Task& task, int environments);
  static double bytes(const Task& task);  ///< per environment

  /// Makes all environments start the episodes that the batch has drawn.
  void restart(const Batch& batch);
  /// From environment `first` on, makes those whose episode is over start another one at their next
  /// action. Environment e plays e, e + E, e + 2 E … counted from the first episode.
  void start_next(int first, int environments);

  std::vector<double> task_state, action, observation, u, q, v;
  std::vector<double> reward, returns;
  std::vector<std::uint8_t> terminated, truncated, success, starting;
  std::vector<std::int64_t> length, episodes, next_episode;
  std::vector<EnvironmentState> state;
  std::vector<Snapshot> now;  ///< views of q and v
};

class BlockWorker {
 public:
  BlockWorker(const Task& task, Precision precision);

  // The caller steps the batch. An action is: begin; for every step k compute_controls, step,
  // record_snapshot; then conclude.

  /// `actions`: (E, action); empty if every environment of the block starts.
  void begin(Batch& batch, EnvironmentData& data, int block, std::span<const double> actions);
  /// Writes the controls for step k into data.u.
  void compute_controls(const Batch& batch, EnvironmentData& data, int block, int step) const;
  void record_snapshot(const Batch& batch, int block, int step, VectorCounts& counts);
  /// Replaces steps and snapshots if every environment starts and there is no warm-up.
  void record_start(const Batch& batch, int block);
  void conclude(Batch& batch, EnvironmentData& data, int block, VectorCounts& counts);
  /// Snapshots of a lane of the block that was read last.
  [[nodiscard]] std::span<const Snapshot> snapshots(int lane) const;

  static double bytes(const Task& task);

 private:
  void start(Batch& batch, EnvironmentData& data, int environment);
  void settle_start(const Batch& batch, EnvironmentData& data, int environment);
  void take_action(Batch& batch, EnvironmentData& data, int environment,
                   std::span<const double> actions);
  void read_snapshot(const Batch& batch, int block, std::size_t moment);
  void conclude_one(Batch& batch, EnvironmentData& data, int environment, VectorCounts& counts);
  [[nodiscard]] std::span<double> part(std::vector<double>& snapshots, std::size_t moment,
                                       int lane) const;

  const Task& task_;
  Readout readout_;
  std::optional<Stepper> settling_stepper_;
  std::optional<Batch> settling_;  // one environment
  std::vector<double> varying_;    // values of the environment that starts
  std::vector<double> q_, v_, end_effectors_, tactile_, bodies_, shear_;  // (snapshots, 16, width)
  std::optional<ShearStateArrays> shear_arrays_;                          // if they are read
  std::vector<Snapshot> moments_;  // (16, snapshots): views of them
};

/// Returns the view of a task between two actions of an environment.
TaskView view_of(const Batch& batch, const EnvironmentData& data, int environment);

}  // namespace tangere
