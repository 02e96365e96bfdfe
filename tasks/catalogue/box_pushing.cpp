// SPDX-License-Identifier: Apache-2.0
// Box pushing: a finger pushes a box to a pose while random pushes disturb it (Xu et al., third
// experiment).
//   reward = -0.01 |Δp/10 mm|² - 0.1 (Δθ/5°)² - |x_tip - x_face|²/(20 mm)² - 0.1 |u|²
// Δp, Δθ: position and angle between box and goal. x_tip, x_face: horizontal middle of the pad and
// of the face that it pushes. u = atanh(a), a: the action, which drives the motors. The paper's
// policy returns u and its motors take tanh(u), so effort and motion are the paper's.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "tasks/catalogue/box_pushing_script.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere {
namespace {

constexpr int kActions = 100;
constexpr int kPushActions = 10;  // length of a random push [actions], 0.25 s
constexpr double kAngleUnit = std::numbers::pi / 36, kLengthUnit = 0.01, kGap = 0.02;
constexpr double kPosition = 0.01, kAngle = 0.1, kEffort = 0.1;  // weights
constexpr double kMostDrive = 0.999;  // |a| beyond it counts as this much effort, |u| = 3.8
constexpr double kNear = 0.03, kAligned = 0.1;  // bounds of success [m], [rad]
// Task state: the goal's x, y, yaw; the push on the box, in units of its motors.
constexpr std::size_t kGoal = 0, kPush = 3;
constexpr std::size_t kTip = 0, kFace = 3;  // in Snapshot::end_effectors

Scene without_randomisation(Scene scene) {
  scene.randomizations.clear();
  return scene;
}

class BoxPushing : public Task {
 public:
  BoxPushing(const Scene& scene, PushObservation observation, Friction friction)
      : Task(without_randomisation(scene), declare_box_pushing(observation, friction)),
        observation_(observation),
        turn_(coordinate("hand_turn")),
        slide_(coordinate("hand_slide")),
        box_(coordinate("box_slide")),
        box_turn_(coordinate("box_turn")),
        script_(model().scene(), friction) {
    if (model().end_effectors().size() != 2 || model().end_effectors()[0].name != "tip" ||
        model().end_effectors()[1].name != "face")
      throw InputError(model().scene().path + ": box pushing needs the end effectors tip and face");
  }

  void start(const TaskStart& s) const override {
    const auto number = [&](std::uint32_t k, double low, double high) {
      return task_uniform(s.seed, s.episode, 0, k, low, high);
    };
    s.q[box_ + 1] = number(0, -0.02, 0.02);
    const double along = number(1, 0.15, 0.25), aside = number(2, -0.2, 0.2);
    s.task_state[kGoal] = script_.box_rest()[0] + along;
    s.task_state[kGoal + 1] = script_.box_rest()[1] + aside;
    const double yaw = std::numbers::pi * aside, spread = std::numbers::pi / 16;
    s.task_state[kGoal + 2] = number(3, yaw - spread, yaw + spread);
  }

  /// Every tenth action draws a new push or none, each with probability ½.
  void begin_action(const TaskView& view, std::span<double> memory) const override {
    if (view.actions % kPushActions != 0) return;
    const auto number = [&](std::uint32_t k) {
      return task_uniform(view.seed, view.episode, 1 + view.actions, k, -1, 1);
    };
    const bool pushed = number(0) < 0;
    for (std::uint32_t k = 0; k < 2; ++k) memory[kPush + k] = pushed ? number(1 + k) : 0;
  }

  void controls(const TaskView& view, int, std::span<double> u) const override {
    for (std::size_t k = 0; k < 3; ++k) u[k] = view.action[k];
    u[3] = view.task_state[kPush];
    u[4] = view.task_state[kPush + 1];
    u[5] = 0;
  }

  void observe(const TaskView& view, std::span<double> o) const override {
    const Snapshot& now = view.now();
    in_hand(now, {view.task_state[kGoal], view.task_state[kGoal + 1], view.task_state[kGoal + 2]},
            o.first(3));
    if (observation_ == PushObservation::privileged) in_hand(now, box_pose(now), o.subspan(3));
    if (observation_ == PushObservation::tactile)
      std::copy(now.tactile.begin(), now.tactile.end(), o.begin() + 3);
  }

  void observe_vjp(const TaskView& view, std::span<const double> weight,
                   const ViewCotangent& out) const override {
    // Every joint here slides or turns about one axis: coordinates and dofs have the same places.
    const Snapshot& now = view.now();
    const SnapshotCotangent& to = out.snapshots.back();
    const std::array<double, 3> goal_bar = in_hand_vjp(
        now, {view.task_state[kGoal], view.task_state[kGoal + 1], view.task_state[kGoal + 2]},
        weight, to);
    for (std::size_t k = 0; k < 3; ++k) out.task_state[kGoal + k] += goal_bar[k];
    if (observation_ == PushObservation::privileged) {
      const std::array<double, 3> box_bar = in_hand_vjp(now, box_pose(now), weight.subspan(3), to);
      for (std::size_t k = 0; k < 2; ++k) to.q[box_ + k] += box_bar[k];
      to.q[box_turn_] += box_bar[2];
    }
    if (observation_ == PushObservation::tactile)
      for (std::size_t i = 0; i < to.tactile.size(); ++i) to.tactile[i] += weight[3 + i];
  }

  StepOutcome evaluate(const TaskView& view) const override {
    const std::array<double, 3> off = to_goal(view);
    const Snapshot& now = view.now();
    double gap = 0, effort = 0;
    for (std::size_t k = 0; k < 2; ++k)
      gap += square(now.end_effectors[kTip + k] - now.end_effectors[kFace + k]);
    for (const double a : view.action) effort += square(push_of(a));
    const double distance = square(off[0]) + square(off[1]);
    const double reward = -kPosition * distance / square(kLengthUnit) -
                          kAngle * square(off[2] / kAngleUnit) - gap / square(kGap) -
                          kEffort * effort;
    const bool there = distance < square(kNear) && std::abs(off[2]) < kAligned;
    return {reward, false, view.actions == kActions && there};
  }

  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    const std::array<double, 3> off = to_goal(view);
    const Snapshot& now = view.now();
    const SnapshotCotangent& to = out.snapshots.back();
    // Every joint here slides or turns about one axis: coordinates and dofs have the same places.
    for (std::size_t k = 0; k < 2; ++k) {
      const double place_bar = weight * 2 * kPosition * off[k] / square(kLengthUnit);
      to.q[box_ + k] -= place_bar;
      out.task_state[kGoal + k] += place_bar;
      const double gap =
          weight * 2 * (now.end_effectors[kTip + k] - now.end_effectors[kFace + k]) / square(kGap);
      to.end_effectors[kTip + k] -= gap;
      to.end_effectors[kFace + k] += gap;
    }
    const double yaw_bar = weight * 2 * kAngle * off[2] / square(kAngleUnit);
    to.q[box_turn_] -= yaw_bar;
    out.task_state[kGoal + 2] += yaw_bar;
    for (std::size_t k = 0; k < 3; ++k) {
      const double a = view.action[k];
      if (std::abs(a) <= kMostDrive)
        out.action[k] -= weight * 2 * kEffort * push_of(a) / (1 - square(a));
    }
  }

  void controls_vjp(const TaskView&, int, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < 3; ++k) out.action[k] += weight[k];
    for (std::size_t k = 0; k < 2; ++k) out.task_state[kPush + k] += weight[3 + k];
  }

  void begin_action_vjp(const TaskView& view, std::span<double> memory,
                        const ViewCotangent&) const override {
    if (view.actions % kPushActions != 0) return;
    memory[kPush] = memory[kPush + 1] = 0;  // begin_action draws the push
  }

  /// Feeds back the state, whatever the task observes.
  void scripted(const TaskView& view, std::span<const double>,
                std::span<double> action) const override {
    const Snapshot& now = view.now();
    const std::array<double, 3> box = box_pose(now);
    const PushState state = {
        now.q[turn_],
        {now.q[slide_], now.q[slide_ + 1]},
        box,
        {view.task_state[kGoal], view.task_state[kGoal + 1], view.task_state[kGoal + 2]}};
    const std::array<double, 3> u = script_.controls(state);
    for (std::size_t k = 0; k < 3; ++k) action[k] = std::clamp(u[k], -0.99, 0.99);
  }

 private:
  static double square(double x) { return x * x; }
  /// u of the reward.
  static double push_of(double a) { return std::atanh(std::clamp(a, -kMostDrive, kMostDrive)); }

  /// x, y [m] and yaw [rad] in the world.
  [[nodiscard]] std::array<double, 3> box_pose(const Snapshot& now) const {
    return {script_.box_rest()[0] + now.q[box_], script_.box_rest()[1] + now.q[box_ + 1],
            now.q[box_turn_]};
  }
  /// Pose of the box minus its goal.
  [[nodiscard]] std::array<double, 3> to_goal(const TaskView& view) const {
    std::array<double, 3> off = box_pose(view.now());
    for (std::size_t k = 0; k < 3; ++k) off[k] -= view.task_state[kGoal + k];
    return off;
  }
  /// Writes a pose relative to the middle of the pad; the pad pushes along x.
  void in_hand(const Snapshot& now, const std::array<double, 3>& pose, std::span<double> o) const {
    const double c = std::cos(now.q[turn_]), s = std::sin(now.q[turn_]);
    const double x = pose[0] - now.end_effectors[kTip], y = pose[1] - now.end_effectors[kTip + 1];
    o[0] = c * x + s * y;
    o[1] = c * y - s * x;
    o[2] = pose[2] - now.q[turn_];
  }
  /// Reverse of in_hand(): returns derivatives by the pose and adds those by the hand. With θ the
  /// hand's turn: ∂o_x/∂θ = o_y, ∂o_y/∂θ = -o_x.
  std::array<double, 3> in_hand_vjp(const Snapshot& now, const std::array<double, 3>& pose,
                                    std::span<const double> weight,
                                    const SnapshotCotangent& to) const {
    std::array<double, 3> o{};
    in_hand(now, pose, o);
    const double c = std::cos(now.q[turn_]), s = std::sin(now.q[turn_]);
    const double x_bar = c * weight[0] - s * weight[1], y_bar = s * weight[0] + c * weight[1];
    to.end_effectors[kTip] -= x_bar;
    to.end_effectors[kTip + 1] -= y_bar;
    to.q[turn_] += weight[0] * o[1] - weight[1] * o[0] - weight[2];
    return {x_bar, y_bar, weight[2]};
  }

  PushObservation observation_;
  std::size_t turn_, slide_, box_, box_turn_;
  PushScript script_;
};

}  // namespace

TaskSpec declare_box_pushing(PushObservation observation, Friction friction) {
  const std::vector<double> pose_scale = {0.1, 0.1, 0.3}, tactile_scale = {0.01, 0.01, 0.02};
  TaskSpec spec;
  spec.name = "box_pushing";
  spec.summary = "A finger pushes a box to a pose; the goal and the field of the pad are observed.";
  spec.scene = "box_pushing.xml";
  spec.success = "the box is within 30 mm and 0.1 rad of its goal after the last action";
  spec.action = {"drive", {3}, "1", "times 1 N, 1 N (the hand's x, y) and 3 N m (its turn)",
                 {},      -1,  1};
  spec.observations = {
      {"goal", {3}, "m m rad", "goal of the box: x, y, yaw as seen from the pad", pose_scale}};
  spec.steps_per_action = 5;
  spec.snapshots = {5};
  spec.horizon = kActions;
  spec.task_state = 5;
  spec.reads_end_effectors = true;
  if (observation == PushObservation::tactile) {
    spec.observations.push_back({"tactile", {13, 10, 3}, "N", "field of the pad", tactile_scale});
    spec.observations.back().touch = true;
    spec.reads_tactile = true;
  } else if (observation == PushObservation::privileged) {
    spec.name = "box_pushing_privileged";
    spec.summary = "The same; the goal and the box's pose are observed.";
    spec.observations.push_back(
        {"box", {3}, "m m rad", "the box: x, y, yaw as seen from the pad", pose_scale});
    spec.observations.back().privileged = true;
  } else {
    spec.name = "box_pushing_reduced";
    spec.summary = "The same; the goal alone is observed.";
  }
  return with_friction(std::move(spec), friction);
}

std::unique_ptr<Task> make_box_pushing(const Scene& scene, PushObservation observation,
                                       Friction friction) {
  return std::make_unique<BoxPushing>(scene, observation, friction);
}

}  // namespace tangere
