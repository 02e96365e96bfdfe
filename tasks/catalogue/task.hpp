// SPDX-License-Identifier: Apache-2.0
// A task: a scene plus how an episode starts, what an action does, what is seen, what it is worth
// and when it ends. Every function is pure: it looks at numbers of one environment and fills
// numbers of it, so that any of them can be called alone, from any thread, and differentiated.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/model/model.hpp"
#include "engine/rows/task_spec.hpp"

namespace tangere {

/// An environment at one time.
struct Moment {
  std::span<const double> q, v;           ///< (nq), (nv)
  std::span<const double> end_effectors;  ///< (n, 3) end effectors [m], if the task looks at them
  std::span<const double>
      tactile;  ///< every sensor's (points, 3) [N] one behind the other, if the task looks at them
};

/// What a task may look at.
struct TaskView {
  std::uint64_t seed = 0;
  std::int64_t episode = 0;
  std::int64_t actions = 0;        ///< of this episode, taken until now
  std::span<const double> memory;  ///< (memory)
  std::span<const double> action;  ///< the one being taken or just taken; empty before the first
  std::span<const Moment>
      moments;  ///< of that action, as declared; before an action only where it starts

  [[nodiscard]] const Moment& now() const { return moments.back(); }
};

/// The start of an episode, as the scene has drawn it; a task changes what it likes.
struct TaskStart {
  std::uint64_t seed = 0;
  std::int64_t episode = 0;
  std::span<double> q, v;     ///< (nq), (nv)
  std::span<double> varying;  ///< values of what the scene randomises, in its order; those of the
                              ///< state change nothing
  std::span<double> memory;   ///< (memory), zeros
};

/// What a state is worth.
struct Verdict {
  double reward = 0;
  bool terminated = false;  ///< the episode ends here, not for want of time
  bool success = false;
};

/// Where derivatives of a moment are added; q by displacements along the dofs of v, rotations on
/// the right (docs/dynamics.md), the others component by component. What the task does not look at
/// is empty.
struct MomentCotangent {
  std::span<double> q, v;           ///< (nv), (nv)
  std::span<double> end_effectors;  ///< (n, 3)
  std::span<double> tactile;        ///< as in Moment
};
struct ViewCotangent {
  std::span<const MomentCotangent> moments;  ///< parallel to TaskView::moments
  std::span<double> action;
  std::span<double> memory = {};  ///< (memory)
};

class Task {
 public:
  /// Throws InputError when the declaration contradicts itself or the scene cannot be compiled.
  Task(const Scene& scene, TaskSpec spec);
  virtual ~Task() = default;
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;

  [[nodiscard]] const TaskSpec& spec() const { return spec_; }
  [[nodiscard]] const Model& model() const { return model_; }
  [[nodiscard]] std::size_t tactile_size() const;  ///< numbers of Moment::tactile
  [[nodiscard]] std::size_t end_effectors_size() const;

  /// Starts an episode: as drawn, unless a task says more.
  virtual void start(const TaskStart& start) const;
  /// Before an action's first step: what the task keeps of it for all of them.
  virtual void begin_action(const TaskView& view, std::span<double> memory) const;
  /// Of a task that restarts, the state that the action begins from; q and v are where the last one
  /// ended.
  virtual void place(const TaskView& view, std::span<double> q, std::span<double> v) const;
  /// Controls (nu) for the steps of an action from `step` on.
  virtual void controls(const TaskView& view, int step, std::span<double> u) const = 0;
  /// The observations, one behind the other.
  virtual void observe(const TaskView& view, std::span<double> observation) const = 0;
  virtual Verdict judge(const TaskView& view) const = 0;

  /// Adds `weight` times the derivative of the reward to `out`. What only chooses between cases has
  /// none.
  virtual void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const = 0;
  /// Adds ∂(weight · u)/∂(action, memory, q and v of the action's start) of controls(view, step,
  /// u), `weight`: (nu).
  virtual void controls_vjp(const TaskView& view, int step, std::span<const double> weight,
                            const ViewCotangent& out) const = 0;

  /// begin_action in reverse. `memory` holds derivatives by what it leaves and gets those by what
  /// it found, view.memory; those by the action, and by q and v of its start, are added to `out`.
  /// As it stands: nothing that it writes has a derivative.
  virtual void begin_action_vjp(const TaskView& view, std::span<double> memory,
                                const ViewCotangent& out) const;
  /// place in reverse: adds ∂(q̄·q + v̄·v)/∂(action, memory, q and v where the last action ended),
  /// `q`, `v`: (nv). A task that restarts has to have it; as it stands it throws InputError.
  virtual void place_vjp(const TaskView& view, std::span<const double> q, std::span<const double> v,
                         const ViewCotangent& out) const;

  /// An action that solves the task without having learned anything.
  virtual void scripted(const TaskView& view, std::span<const double> observation,
                        std::span<double> action) const = 0;

 protected:
  /// First coordinate of a joint of the scene, or its first dof. Throws InputError when the scene
  /// has no such joint.
  [[nodiscard]] std::size_t coordinate(const std::string& joint) const;
  [[nodiscard]] std::size_t dof(const std::string& joint) const;

 private:
  Model model_;
  TaskSpec spec_;
};

/// A number in [low, high] of an episode: `step` and `index` tell it from the task's others.
double task_uniform(std::uint64_t seed, std::int64_t episode, std::int64_t step,
                    std::uint32_t index, double low, double high);
double task_normal(std::uint64_t seed, std::int64_t episode, std::int64_t step, std::uint32_t index,
                   double deviation);

}  // namespace tangere
