// SPDX-License-Identifier: Apache-2.0
// Policies of data sets and benchmarks: built-in ones, or an external program that computes actions
// for many environments at once.
#pragma once

#include <cstdint>
#include <functional>
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
  program,   ///< external, a function of the task's observations
};
const char* to_string(PolicyKind kind);

/// Random variation of scripted episodes, which widens the distribution of states and actions.
struct PolicyVariation {
  /// Standard deviation of a normal number that is added to every number of a scripted action, in
  /// the action's unit. The sum is kept within the action's bounds. Keyed by (seed, episode,
  /// action).
  double noise = 0;
  /// Share of the episodes, 0 to 1, that the random policy plays. Drawn by (seed, episode).
  double random_share = 0;
};

/// Inputs of an external policy for the next actions of n environments.
struct PolicyInputs {
  std::span<const std::int64_t> episodes;  ///< (n) their numbers
  std::span<const std::int64_t> actions;   ///< (n) actions taken in them so far
  std::span<const double> observations;    ///< (n, observation)
};
/// Writes (n, action). Many threads may call it at once. The environments of a call are those of
/// one block of 16 whose episodes have not ended, for any number of threads.
using PolicyFunction = std::function<void(const PolicyInputs&, std::span<double> actions)>;

class Policy {
 public:
  /// `table`: (rows, action), for csv. Throws InputError when a row does not fit the task's action
  /// or there is no row, for a variation of another kind than scripted, and for a noise or a share
  /// out of its range.
  Policy(const Task& task, PolicyKind kind, std::vector<std::vector<double>> table = {},
         const PolicyVariation& variation = {});
  /// A program called `name`. Throws InputError for a noise or a share out of its range.
  Policy(const Task& task, std::string name, PolicyFunction function,
         const PolicyVariation& variation = {});

  /// Whether act() for many environments is one question and not one for each.
  [[nodiscard]] bool is_batched() const { return static_cast<bool>(function_); }

  /// Names of those that play: the kind, and "random" where it has a share.
  [[nodiscard]] std::vector<std::string> players() const;
  /// Index in players() of the one that plays an episode. It depends on seed and episode alone.
  [[nodiscard]] int player(std::uint64_t seed, std::int64_t episode) const;

  /// Computes the next action of an environment from `view` and `observation`.
  void act(const TaskView& view, std::span<const double> observation,
           std::span<double> action) const;
  /// The same for n environments, at most a block: (n, observation) in, (n, action) out.
  void act(std::span<const TaskView> views, std::span<const double> observations,
           std::span<double> actions) const;
  /// Fills the actions of all environments, (E, action).
  void act(const VectorTask& environments, std::span<double> actions) const;

 private:
  void draw(const TaskView& view, std::span<double> action) const;
  void disturb(const TaskView& view, std::span<double> action) const;

  void check(const PolicyVariation& variation) const;

  const Task& task_;
  PolicyKind kind_;
  std::string name_;
  PolicyFunction function_;
  std::vector<std::vector<double>> table_;
  PolicyVariation variation_;
};

}  // namespace tangere
