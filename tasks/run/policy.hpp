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

/// What spreads the states and actions of scripted episodes, so that a learner sees more of them.
struct PolicyVariation {
  /// Standard deviation of a normal number that is added to every number of a scripted action, in
  /// the action's unit. The sum is kept within the action's bounds. Keyed by (seed, episode,
  /// action).
  double noise = 0;
  /// Share of the episodes, 0 to 1, that the random policy plays. Drawn by (seed, episode).
  double random_share = 0;
};

class Policy {
 public:
  /// `table`: (rows, action), for csv. Throws InputError when a row does not fit the task's action
  /// or there is no row, for a variation of another kind than scripted, and for a noise or a share
  /// out of its range.
  Policy(const Task& task, PolicyKind kind, std::vector<std::vector<double>> table = {},
         const PolicyVariation& variation = {});

  /// Names of those that play: the kind, and "random" where it has a share.
  [[nodiscard]] std::vector<std::string> players() const;
  /// Index in players() of the one that plays an episode. It depends on seed and episode alone.
  [[nodiscard]] int player(std::uint64_t seed, std::int64_t episode) const;

  /// The next action of an environment that shows `view` and `observation`.
  void act(const TaskView& view, std::span<const double> observation,
           std::span<double> action) const;
  /// Fills the actions of all environments, (E, action).
  void act(const VectorTask& environments, std::span<double> actions) const;

 private:
  void draw(const TaskView& view, std::span<double> action) const;
  void disturb(const TaskView& view, std::span<double> action) const;

  const Task& task_;
  PolicyKind kind_;
  std::vector<std::vector<double>> table_;
  PolicyVariation variation_;
};

}  // namespace tangere
