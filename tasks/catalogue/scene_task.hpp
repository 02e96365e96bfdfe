// SPDX-License-Identifier: Apache-2.0
// A scene as a task that rewards nothing: an action is the controls of some steps, and everything
// that the scene reads is observed. So a tape of a task (tasks/gradients/task_tape.hpp) is also one
// of any scene.
#pragma once

#include <string>
#include <vector>

#include "tasks/catalogue/task.hpp"

namespace tangere {

class SceneTask : public Task {
 public:
  /// `steps`: of the simulation for each action. `horizon`: actions of an episode. Observations are
  /// q (nq), v (nv), the end effectors (n, 3) if there are any, and the field of each sensor (rows,
  /// columns, 3) in the order of the scene. Throws InputError for a scene that cannot be compiled,
  /// and for one without motors.
  SceneTask(const Scene& scene, int steps, int horizon);

  /// Sets the numbers of <randomize> instead of drawing them, in order, for episodes 0 to
  /// rows.size()/k - 1, where k is their count. Empty: they are drawn. No episode may be played at
  /// the same time.
  void set_varying(std::vector<double> rows) { varying_ = std::move(rows); }

  void start(const TaskStart& start) const override;
  void controls(const TaskView& view, int step, std::span<double> u) const override;
  void observe(const TaskView& view, std::span<double> observation) const override;
  StepOutcome evaluate(const TaskView&) const override { return {}; }
  void reward_vjp(const TaskView&, double, const ViewCotangent&) const override {}
  void observe_vjp(const TaskView& view, std::span<const double> weight,
                   const ViewCotangent& out) const override;
  void controls_vjp(const TaskView& view, int step, std::span<const double> weight,
                    const ViewCotangent& out) const override;

 private:
  std::vector<double> varying_;
};

}  // namespace tangere
