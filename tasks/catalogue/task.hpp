// SPDX-License-Identifier: Apache-2.0
// Interface of a task: a scene with initial states, actions, observations, rewards and ends of
// episodes. Every function is pure: it reads and fills numbers of one environment, and can be
// called from any thread and differentiated.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/model/model.hpp"
#include "engine/rows/task_spec.hpp"

namespace tangere {

/// The state of an environment at one time.
struct Snapshot {
  std::span<const double> q, v;           ///< (nq), (nv)
  std::span<const double> end_effectors;  ///< (n, 3) positions [m], if TaskSpec requests them
  /// (points, 3) or (points, 1) [N] of each of Task::fields() in turn, if TaskSpec requests them
  std::span<const double> tactile;
  /// (nb, 7) poses, then (nb, 6) twists of the bodies, as Readout::bodies() returns them, if
  /// TaskSpec requests them
  std::span<const double> bodies = {};
  /// (points, 3) shear state [m] (engine/step/shear_state_arrays.hpp), if TaskSpec requests it
  std::span<const double> shear_state = {};
};

/// Inputs of the functions of a task.
struct TaskView {
  std::uint64_t seed = 0;
  std::int64_t episode = 0;
  std::int64_t actions = 0;            ///< taken in this episode so far
  std::span<const double> task_state;  ///< (task_state)
  std::span<const double> action;      ///< the current or the last action; empty before the first
  std::span<const Snapshot>
      snapshots;  ///< of that action, as declared; before an action only its start

  [[nodiscard]] const Snapshot& now() const { return snapshots.back(); }
};

/// The start of an episode as the scene has drawn it. A task may change any of it.
struct TaskStart {
  std::uint64_t seed = 0;
  std::int64_t episode = 0;
  std::span<double> q, v;        ///< (nq), (nv)
  std::span<double> varying;     ///< values of <randomize>, in order; states have no effect
  std::span<double> task_state;  ///< (task_state), zeros
};

/// Reward and end of an action.
struct StepOutcome {
  double reward = 0;
  bool terminated = false;  ///< the episode ends here, and not because time ran out
  bool success = false;
};

/// Accumulates cotangents of a Snapshot. Those of q are along the dofs of v, with rotations on the
/// right (docs/dynamics.md); the others are by component. Quantities that the task does not request
/// are empty.
struct SnapshotCotangent {
  std::span<double> q, v;              ///< (nv), (nv)
  std::span<double> end_effectors;     ///< (n, 3)
  std::span<double> tactile;           ///< as in Snapshot
  std::span<double> bodies = {};       ///< as in Snapshot
  std::span<double> shear_state = {};  ///< as in Snapshot
};
struct ViewCotangent {
  std::span<const SnapshotCotangent> snapshots;  ///< parallel to TaskView::snapshots
  std::span<double> action;
  std::span<double> task_state = {};  ///< (task_state)
  /// (tactile points, kPointNumbers) of observations that use places of points themselves; empty
  /// unless requested
  std::span<double> points = {};
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
  /// What Snapshot::tactile holds: TaskSpec::fields, or the field of every sensor.
  [[nodiscard]] std::span<const FieldOutput> fields() const { return fields_; }
  [[nodiscard]] std::size_t tactile_size() const;  ///< numbers in Snapshot::tactile
  [[nodiscard]] std::size_t end_effectors_size() const;
  [[nodiscard]] std::size_t bodies_size() const;
  [[nodiscard]] std::size_t shear_state_size() const;

  /// Starts an episode as drawn, unless a task overrides this.
  virtual void start(const TaskStart& start) const;
  /// Called before an action's first step. Updates the task state, which is constant during the
  /// action.
  virtual void begin_action(const TaskView& view, std::span<double> memory) const;
  /// For a task that restarts: sets the state in which the action begins. On entry q and v are the
  /// state after the last action.
  virtual void restart_state(const TaskView& view, std::span<double> q, std::span<double> v) const;
  /// Fills the controls (nu) for the steps of an action from `step` on.
  virtual void controls(const TaskView& view, int step, std::span<double> u) const = 0;
  /// Fills the observations, one after the other.
  virtual void observe(const TaskView& view, std::span<double> observation) const = 0;
  virtual StepOutcome evaluate(const TaskView& view) const = 0;

  /// Adds `weight` times the derivative of the reward to `out`. A choice between cases has no
  /// derivative. Only gradients of returns need it; the default throws InputError.
  virtual void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const;
  /// Adds ∂(weight · o)/∂(snapshots, action, task state), where o is the result of observe(view, o)
  /// and `weight` is (observation). Noise counts as given. At a choice between cases or a threshold
  /// it is the derivative of the case at hand, at a clamp that of its inside. Gradients through
  /// observations need it (tasks/gradients/task_tape.hpp); the default throws InputError.
  virtual void observe_vjp(const TaskView& view, std::span<const double> weight,
                           const ViewCotangent& out) const;
  /// Adds ∂(weight · u)/∂(action, task state, q and v of the action's start), where u is the result
  /// of controls(view, step, u) and `weight` is (nu). Only gradients need it; the default throws
  /// InputError.
  virtual void controls_vjp(const TaskView& view, int step, std::span<const double> weight,
                            const ViewCotangent& out) const;

  /// Pullback of begin_action. On entry, the cotangents of the task state are those after
  /// begin_action; on return, those before it (view.task_state). Adds cotangents of the action and
  /// of q and v of its start to `out`. The default assumes that begin_action has zero derivative.
  virtual void begin_action_vjp(const TaskView& view, std::span<double> memory,
                                const ViewCotangent& out) const;
  /// Pullback of restart_state: adds ∂(q̄·q + v̄·v)/∂(action, task state, q and v after the last
  /// action), where q̄ is `q` and v̄ is `v`, both (nv). A task that restarts must override it; the
  /// default throws InputError.
  virtual void restart_state_vjp(const TaskView& view, std::span<const double> q,
                                 std::span<const double> v, const ViewCotangent& out) const;

  /// Fills an action that solves the task without learning. The default throws InputError.
  virtual void scripted(const TaskView& view, std::span<const double> observation,
                        std::span<double> action) const;

 protected:
  /// First coordinate of a joint of the scene, or its first dof. Throws InputError when the scene
  /// has no such joint.
  [[nodiscard]] std::size_t coordinate(const std::string& joint) const;
  [[nodiscard]] std::size_t dof(const std::string& joint) const;

 private:
  Model model_;
  TaskSpec spec_;
  std::vector<FieldOutput> fields_;
};

/// Returns a number in [low, high] for an episode. `step` and `index` distinguish the numbers of a
/// task.
double task_uniform(std::uint64_t seed, std::int64_t episode, std::int64_t step,
                    std::uint32_t index, double low, double high);
double task_normal(std::uint64_t seed, std::int64_t episode, std::int64_t step, std::uint32_t index,
                   double deviation);

}  // namespace tangere
