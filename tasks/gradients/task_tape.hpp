// SPDX-License-Identifier: Apache-2.0
// Back-propagation through time of a task with actions from the caller: one call per action
// forward, one call per action back, each for all environments. The caller differentiates its
// policy itself:
//   (o_(t+1), r_t) = step(a_t),   a_t = policy(o_t)
//   ā_t = reverse(ō_(t+1), r̄_t),  ō_t += (∂policy/∂o)ᵀ ā_t
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "tasks/catalogue/task.hpp"
#include "tasks/gradients/tape_options.hpp"

namespace tangere {

/// E environments of one task. Environment e plays episode first_episode + e, once. Its bits are
/// those of a VectorTask that solves to the same tolerance; they depend neither on E, nor on
/// threads, nor on tape_bytes, nor on the other environments. An environment whose episode has
/// ended, or whose simulation has failed, keeps its last state and observation.
class TaskTape {
 public:
  /// Makes E environments and resets them. `task` must outlive this object. Throws
  /// InputError for numbers of environments, actions or threads out of range, for a tape_bytes that
  /// does not hold the checkpoints, and for points where a sensor has ks.
  TaskTape(const Task& task, int environments, const TapeOptions& options = {},
           std::uint64_t seed = 0, std::int64_t first_episode = 0);
  ~TaskTape();
  TaskTape(TaskTape&&) noexcept;
  TaskTape& operator=(TaskTape&&) noexcept;

  /// Starts episodes first_episode … first_episode + E - 1 of a seed and clears the tape. `record`:
  /// whether its actions can be reversed; otherwise no state is kept.
  void reset(std::uint64_t seed, std::int64_t first_episode, bool record = true);
  /// Moves the states in which the first actions begin: q (E, nq) with quaternions of unit length,
  /// v (E, nv) and, unless empty, shear states (E, points, 3)
  /// (engine/step/shear_state_arrays.hpp). They are observed again. Throws InputError after the
  /// first step.
  void displace(std::span<const double> q, std::span<const double> v,
                std::span<const double> shear_state = {});
  /// Takes one action of every environment whose episode has not ended, (E, action), clipped to its
  /// bounds, and records it. Actions of ended environments are ignored. Throws InputError for an
  /// action that is not finite, for more than `length` actions, and after reverse(). `varying`:
  /// values of the scene's <randomize> from this action on, (E, their count), which the scene could
  /// have; states among them have no effect. Empty: as before.
  void step(std::span<const double> actions, std::span<const double> varying = {});
  /// Throws what step() would throw for these actions, and takes none.
  void check_step(std::span<const double> actions) const;

  [[nodiscard]] const Task& task() const;
  [[nodiscard]] int environments() const;
  [[nodiscard]] std::int64_t taken() const;  ///< actions since the reset
  /// Views of the results of the last reset or step. They stay valid as long as the object;
  /// reverse() does not change them.
  [[nodiscard]] std::span<const double> observations() const;  ///< (E, observation)
  /// Copies the same into an array of the caller, (E, observation), on all threads.
  void get_observations(std::span<double> to);
  [[nodiscard]] std::span<const double> rewards() const;           ///< (E), 0 if not alive
  [[nodiscard]] std::span<const std::uint8_t> alive() const;       ///< (E) 1: the action was taken
  [[nodiscard]] std::span<const std::uint8_t> terminated() const;  ///< (E) the episode has ended
  /// (E) it ran out of time or had no solution
  [[nodiscard]] std::span<const std::uint8_t> truncated() const;
  [[nodiscard]] std::span<const std::uint8_t> success() const;  ///< (E)
  [[nodiscard]] std::span<const double> q() const;              ///< (E, nq)
  [[nodiscard]] std::span<const double> v() const;              ///< (E, nv)
  /// Status of the simulation. A failure truncates the episode, with the reward of the last state
  /// that was found.
  [[nodiscard]] StepStatus status(int environment) const;
  /// View for a policy with access to the state: the current q, v and task state.
  [[nodiscard]] TaskView view(int environment) const;

  /// Reverses the last action that is not reversed yet; the first call begins at the last action.
  /// In: cotangents of the results of that action; an empty span means zeros. Out: ∂L/∂actions (E,
  /// action) through this action and later ones. It is 0 for a component beyond its bounds and for
  /// an environment that did not take the action. Cotangents of the repeated last observation of an
  /// ended episode count for its last action. Throws InputError when every action is reversed, and
  /// when a task has no Task::observe_vjp or restart_state_vjp that it would need; then only
  /// reset() is possible. `parameter_bar`, (E, NumberGradients::count()) or empty: derivatives by
  /// the values of the scene's numbers that step() set with this action, as long as they held; 0 if
  /// it set none.
  void reverse(const ActionCotangents& results_bar, std::span<double> action_bar,
               std::span<double> parameter_bar = {});
  /// Ends the reverse pass. In: cotangents of the observation at the reset and of the states at the
  /// first action (rewards are ignored). Out: cotangents of these states and, if options request
  /// them, of the scene's numbers while those of the start held and of points of sensors. The
  /// reset, all random draws and snapshots of a warm-up before its last one count as constant.
  /// Throws InputError while actions are left to reverse, and at a second call.
  void reverse_start(const ActionCotangents& results_bar, const StartCotangents& out);
  /// Begins another reverse pass over the same actions, from the last one.
  void begin_reverse();

  /// Simulation steps recomputed from checkpoints since construction, counted by block.
  [[nodiscard]] std::int64_t recomputed_steps() const;
  /// Size of a TaskTape [bytes].
  static double bytes(const Task& task, int environments, const TapeOptions& options = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
