// SPDX-License-Identifier: Apache-2.0
// Ball rolling: a pad presses a ball onto the ground and rolls it to a goal. The paper uses this
// task only to measure speed; the goal and the reward are ours.
//   reward = -|Δ/10 mm|² - 0.01 |a|²,   Δ: ball's centre to the goal, horizontal
#include <algorithm>
#include <cmath>

#include "tasks/catalogue/task_list.hpp"

namespace tangere {
namespace {

constexpr double kReach =
    0.01;  // largest distance of the goal from the ball's start, in x and in y [m]
constexpr double kTolerance = 2e-3;  // [m]
constexpr double kLength = 0.01;     // scale of the distance in the reward [m]
constexpr double kEffort = 0.01;
constexpr std::int64_t kActions = 70;

class BallRolling : public Task {
 public:
  BallRolling(const Scene& scene, BallPad pad)
      : Task(scene, declare_ball_rolling(pad)),
        pad_q_(coordinate("pad_joint")),
        ball_q_(coordinate("ball_joint")),
        pad_v_(dof("pad_joint")),
        ball_v_(dof("ball_joint")) {}

  /// Stores the goal in the task state.
  void start(const TaskStart& s) const override {
    for (std::uint32_t k = 0; k < 2; ++k)
      s.task_state[k] = s.q[ball_q_ + k] + task_uniform(s.seed, s.episode, 0, k, -kReach, kReach);
  }

  void controls(const TaskView& view, int, std::span<double> u) const override {
    std::copy(view.action.begin(), view.action.end(), u.begin());
  }

  void observe(const TaskView& view, std::span<double> o) const override {
    const Snapshot& now = view.now();
    for (std::size_t k = 0; k < 3; ++k) o[k] = now.q[pad_q_ + k];
    for (std::size_t k = 0; k < 2; ++k) o[3 + k] = to_goal(view, k);
    std::copy(now.tactile.begin(), now.tactile.end(), o.begin() + 5);
  }

  void observe_vjp(const TaskView&, std::span<const double> weight,
                   const ViewCotangent& out) const override {
    const SnapshotCotangent& to = out.snapshots.back();
    for (std::size_t k = 0; k < 3; ++k) to.q[pad_v_ + k] += weight[k];
    for (std::size_t k = 0; k < 2; ++k) {
      to.q[ball_v_ + k] -= weight[3 + k];
      out.task_state[k] += weight[3 + k];
    }
    for (std::size_t i = 0; i < to.tactile.size(); ++i) to.tactile[i] += weight[5 + i];
  }

  StepOutcome evaluate(const TaskView& view) const override {
    const double x = to_goal(view, 0), y = to_goal(view, 1);
    double effort = 0;
    for (const double a : view.action) effort += a * a;
    const double reward = -(x * x + y * y) / (kLength * kLength) - kEffort * effort;
    return {reward, false, view.actions == kActions && std::hypot(x, y) < kTolerance};
  }

  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < 2; ++k) {
      const double ball_bar = weight * 2 * to_goal(view, k) / (kLength * kLength);
      out.snapshots.back().q[ball_v_ + k] += ball_bar;
      out.task_state[k] -= ball_bar;
    }
    for (std::size_t k = 0; k < 3; ++k) out.action[k] -= weight * 2 * kEffort * view.action[k];
  }

  void controls_vjp(const TaskView&, int, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < 3; ++k) out.action[k] += weight[k];
  }

  /// The pad's speed is its force divided by its damping, 1 N s/m. The ball rolls at half that
  /// speed.
  void scripted(const TaskView& view, std::span<const double>,
                std::span<double> action) const override {
    constexpr double kRate = 5, kFastest = 0.1;  // [1/s], [m/s]: rate and top speed of the ball
    constexpr double kTouching =
        -0.0155;  // the pad touches below this z; it starts 15 mm above the ball [m]
    const bool touching = view.now().q[pad_q_ + 2] < kTouching;
    for (std::size_t k = 0; k < 2; ++k)
      action[k] = touching ? 2 * std::clamp(kRate * to_goal(view, k), -kFastest, kFastest) : 0;
    action[2] = 0.2;  // presses with 0.045 N
  }

 private:
  [[nodiscard]] double to_goal(const TaskView& view, std::size_t k) const {
    return view.task_state[k] - view.now().q[ball_q_ + k];
  }
  std::size_t pad_q_, ball_q_, pad_v_, ball_v_;
};

}  // namespace

TaskSpec declare_ball_rolling(BallPad pad) {
  const bool large = pad == BallPad::large;
  const std::size_t side = large ? 200 : 32;
  // The small pad's points stand for (200/32)² times the area.
  const std::vector<double> tactile_scale =
      large ? std::vector{2e-6, 2e-6, 1.5e-5} : std::vector{7e-5, 7e-5, 6e-4};
  TaskSpec spec;
  spec.name = large ? "ball_rolling" : "ball_rolling_small";
  spec.summary = large ? "A pad of 200 × 200 tactile points rolls a ball to a goal."
                       : "The same with 32 × 32 tactile points.";
  spec.scene = large ? "rolling_ball.xml" : "rolling_ball_small.xml";
  spec.success = "the ball is within 2 mm of the goal after the last action";
  spec.action = {"force", {3}, "1", "force on the pad, x y z, times 1 N", {}, -1, 1};
  spec.observations = {{"pad", {3}, "m", "position of the pad from its start", {0.01}},
                       {"goal", {2}, "m", "from the ball's centre to the goal, x y", {0.005}},
                       {"tactile", {side, side, 3}, "N", "field of the pad", tactile_scale}};
  spec.observations.back().touch = true;
  spec.steps_per_action = 5;
  spec.snapshots = {5};
  spec.horizon = kActions;
  spec.task_state = 2;
  spec.reads_tactile = true;
  return spec;
}

std::unique_ptr<Task> make_ball_rolling(const Scene& scene, BallPad pad) {
  return std::make_unique<BallRolling>(scene, pad);
}

}  // namespace tangere
