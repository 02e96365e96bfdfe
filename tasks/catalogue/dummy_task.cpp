// SPDX-License-Identifier: Apache-2.0
// The smallest task, meant as a template: hold a pad at the height of a goal. docs/tasks.md
// explains each part.
#include <algorithm>

#include "tasks/catalogue/task_list.hpp"

namespace tangere {
namespace {

class Dummy : public Task {
 public:
  explicit Dummy(const Scene& scene)
      : Task(scene, declare()), z_(coordinate("pad_joint") + 2), vz_(dof("pad_joint") + 2) {}

  static TaskSpec declare() {
    TaskSpec spec;
    spec.name = "dummy";
    spec.summary = "A pad is held at a height.";
    spec.scene = "rolling_ball_small.xml";
    spec.success = "within 1 mm of the goal after 40 actions";
    spec.action = {"force", {1},  "1", "vertical force on the pad, over its weight of 0.245 N [N]",
                   {},      -0.5, 0.5};
    spec.observations = {{"error", {1}, "m", "goal minus height of the pad", {0.01}},
                         {"speed", {1}, "m/s", "upward", {0.05}}};
    spec.steps_per_action = 5;
    spec.snapshots = {5};
    spec.horizon = 40;
    spec.task_state = 1;  // the goal [m]
    return spec;
  }
  void start(const TaskStart& s) const override {
    s.task_state[0] = task_uniform(s.seed, s.episode, 0, 0, 0.01, 0.03);
  }
  void controls(const TaskView& view, int, std::span<double> u) const override {
    u[2] = 0.245 + view.action[0];
  }
  void observe(const TaskView& view, std::span<double> o) const override {
    o[0] = error(view), o[1] = view.now().v[vz_];
  }
  void observe_vjp(const TaskView&, std::span<const double> weight,
                   const ViewCotangent& out) const override {
    out.task_state[0] += weight[0];
    out.snapshots.back().q[vz_] -= weight[0];
    out.snapshots.back().v[vz_] += weight[1];
  }
  StepOutcome evaluate(const TaskView& view) const override {
    return {-1e4 * error(view) * error(view), false,
            view.actions == spec().horizon && std::abs(error(view)) < 1e-3};
  }
  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    out.snapshots.back().q[vz_] += weight * 2e4 * error(view);
    out.task_state[0] -= weight * 2e4 * error(view);
  }
  void controls_vjp(const TaskView&, int, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    out.action[0] += weight[2];
  }
  void scripted(const TaskView& view, std::span<const double> o,
                std::span<double> action) const override {
    action[0] = std::clamp(10 * o[0] - view.now().v[vz_], -0.5, 0.5);
  }

 private:
  [[nodiscard]] double error(const TaskView& view) const {
    return view.task_state[0] - view.now().q[z_];
  }
  std::size_t z_, vz_;  // of the pad: coordinate, dof
};

}  // namespace

std::unique_ptr<Task> make_dummy(const Scene& scene) { return std::make_unique<Dummy>(scene); }
TaskSpec declare_dummy() { return Dummy::declare(); }

}  // namespace tangere
