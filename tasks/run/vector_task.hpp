// SPDX-License-Identifier: Apache-2.0
// Many environments of one task, stepped together. Each has its own episode, clock and varying
// numbers, and starts its next episode by itself. The interface follows Gymnasium's vector
// interface with next-step autoreset.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/rows/episode_channels.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/catalogue/task.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere {

struct VectorOptions {
  std::uint64_t seed = 0;
  std::int64_t first_episode = 0;  ///< of environment 0
  int threads = 1;
  Precision precision = Precision::mixed;  ///< of tactile fields
  /// Whether an environment starts another episode after its end. If not, it keeps its last state
  /// and shows it again.
  bool autoreset = true;
  /// Readings of sensors beside what the task observes: "pad.sum" at every row, "pad" with times of
  /// n steps as a window of K / n readings, K steps of an action (docs/outputs.md).
  std::vector<TimedName> readings = {};
};

/// Environment e plays episodes first + e, first + e + E, first + e + 2 E … An episode depends only
/// on the task, the seed, its number and the actions, not on E, threads, or the other environments.
class VectorTask {
 public:
  /// Makes E environments and resets them. `task` must outlive this object. Throws InputError when
  /// E or threads is below 1, and for readings that the scene does not have or that are no window.
  VectorTask(const Task& task, int environments, const VectorOptions& options = {});
  ~VectorTask();
  VectorTask(VectorTask&&) noexcept;
  VectorTask& operator=(VectorTask&&) noexcept;

  /// Starts the first episodes of a seed: those from options.first_episode on, or from another.
  void reset(std::uint64_t seed);
  void reset(std::uint64_t seed, std::int64_t first_episode);
  /// Starts the next episode of every environment whose `which`, (E), is not 0, whether its episode
  /// has ended or not. The results of the others stay, except that they are not `starting`. Throws
  /// InputError when `which` has another size.
  void restart(std::span<const std::uint8_t> which);
  /// Takes one action of every environment, (E, action). An environment whose episode ended in the
  /// step before ignores its action and starts its next episode, with reward 0. Actions
  /// are clipped to their bounds. An action that is not a number fails its environment.
  void step(std::span<const double> actions);

  [[nodiscard]] const Task& task() const;
  [[nodiscard]] std::uint64_t seed() const;
  [[nodiscard]] int environments() const;
  /// Views of the results of the last reset or step. They stay valid as long as the object.
  [[nodiscard]] std::span<const double> observations() const;  ///< (E, observation)
  [[nodiscard]] std::span<const double> observation(int environment) const;
  [[nodiscard]] std::span<const double> actions()
      const;  ///< (E, action) as taken: clipped, zeros in a reset
  [[nodiscard]] std::span<const double> rewards() const;  ///< (E)
  [[nodiscard]] std::span<const std::uint8_t> terminated()
      const;  ///< (E) the episode ended: 0 or 1
  [[nodiscard]] std::span<const std::uint8_t> truncated()
      const;  ///< (E) it ran out of time or had no solution
  [[nodiscard]] std::span<const std::uint8_t> success() const;   ///< (E)
  [[nodiscard]] std::span<const std::uint8_t> starting() const;  ///< (E) the step was a reset
  [[nodiscard]] std::span<const double> returns()
      const;  ///< (E) sum of the episode's rewards so far
  [[nodiscard]] std::span<const std::int64_t> lengths() const;   ///< (E) its actions so far
  [[nodiscard]] std::span<const std::int64_t> episodes() const;  ///< (E) its number
  /// Status of the simulation. A failure truncates the episode, with the reward of the last state
  /// that was found, or 0 where the action makes that no number.
  [[nodiscard]] StepStatus status(int environment) const;
  /// View for a policy with access to the state: the current q, v and task state.
  [[nodiscard]] TaskView view(int environment) const;
  /// Of the steps since the last reset(seed), over all environments.
  [[nodiscard]] VectorCounts counts() const;
  /// What options.readings names, in the order of data sets.
  [[nodiscard]] const std::vector<EpisodeChannel>& readings() const;
  /// Views, (E, numbers of a row), of the last reset or step; empty where the other one has them.
  [[nodiscard]] std::span<const float> reading(std::size_t k) const;         ///< in SI units
  [[nodiscard]] std::span<const std::uint8_t> colours(std::size_t k) const;  ///< 0 to 255
  /// The states themselves.
  [[nodiscard]] const Batch& batch() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
