// SPDX-License-Identifier: Apache-2.0
// A user-defined task in a user's program: press a ball with a force that differs from episode to
// episode. The program has all subcommands of `tangere`, and this task.
#include <algorithm>
#include <cmath>

#include "apps/program.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace {

using namespace tangere;

class Press : public Task {
 public:
  explicit Press(const Scene& scene) : Task(scene, declare()), z_(coordinate("pad")) {}

  static TaskSpec declare() {
    TaskSpec spec;
    spec.name = "press";
    spec.summary = "A pad presses a ball with a force.";
    spec.scene = OWN_SCENES "/press.xml";
    spec.success = "within 20 mN of the goal after 30 actions";
    spec.action = {"step", {1}, "1", "change of the pad's target [mm]", {}, -1, 1};
    spec.observations = {{"error", {1}, "N", "goal minus what the skin feels", {0.1}},
                         {"field", {8, 8, 3}, "N", "what the skin feels", {0.01}}};
    spec.observations.back().touch = true;
    spec.reads_tactile = true;
    spec.steps_per_action = 5;
    spec.snapshots = {5};
    spec.horizon = 30;
    spec.task_state = 2;  // the goal [N], the pad's target [m]
    return spec;
  }
  void start(const TaskStart& s) const override {
    s.task_state[0] = task_uniform(s.seed, s.episode, 0, 0, 0.05, 0.3);
    s.task_state[1] = 0;
  }
  void begin_action(const TaskView& view, std::span<double> state) const override {
    state[1] = view.now().q[z_] + 1e-3 * view.action[0];
  }
  void controls(const TaskView& view, int, std::span<double> u) const override {
    u[0] = view.task_state[1];
  }
  void observe(const TaskView& view, std::span<double> o) const override {
    o[0] = error(view);
    std::copy(view.now().tactile.begin(), view.now().tactile.end(), o.begin() + 1);
  }
  StepOutcome evaluate(const TaskView& view) const override {
    return {-std::abs(error(view)), false,
            view.actions == spec().horizon && std::abs(error(view)) < 0.02};
  }
  void scripted(const TaskView&, std::span<const double> o,
                std::span<double> action) const override {
    action[0] = std::clamp(-10 * o[0], -1.0, 1.0);
  }

 private:
  [[nodiscard]] static double error(const TaskView& view) {
    double force = 0;  // the third number of a point is its pressure
    for (std::size_t p = 2; p < view.now().tactile.size(); p += 3) force += view.now().tactile[p];
    return view.task_state[0] - force;
  }
  std::size_t z_;  // of the pad
};

std::unique_ptr<Task> make_press(const Scene& scene) { return std::make_unique<Press>(scene); }

}  // namespace

int main(int argc, char** argv) {
  add_task({Press::declare, make_press});
  return run_program(argc, argv);
}
