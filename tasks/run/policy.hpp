// SPDX-License-Identifier: Apache-2.0
// Policies that need no learning. They drive data sets and benchmarks of tasks.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tasks/run/vector_task.hpp"

namespace tangere {

enum class PolicyKind {
  random,    ///< uniform within the bounds of the action, ±1 where it has none; keyed by (seed,
             ///< episode, action)
  hold,      ///< zeros
  csv,       ///< row j of a table for action j of every episode; the last row after its end
  scripted,  ///< the task's own solution
};
const char* to_string(PolicyKind kind);

class Policy {
 public:
  /// `table`: (rows, action), for csv. Throws InputError when a row does not fit the task's action
  /// or there is no row.
  Policy(const Task& task, PolicyKind kind, std::vector<std::vector<double>> table = {});

  /// The next action of an environment that shows `view` and `observation`.
  void act(const TaskView& view, std::span<const double> observation,
           std::span<double> action) const;
  /// Fills the actions of all environments, (E, action).
  void act(const VectorTask& environments, std::span<double> actions) const;

 private:
  const Task& task_;
  PolicyKind kind_;
  std::vector<std::vector<double>> table_;
};

}  // namespace tangere
