// SPDX-License-Identifier: Apache-2.0
// In hand: four fingers turn an object below a palm about the palm's axis until its long axis
// points where the goal says. How the object lies, its size, mass and friction and the gains of the
// motors are not observed. An action is 250 steps of a gait (in_hand_gait.hpp).
//   reward = -(e/30°)², +10 if |e| < 10° after the last action, -10 if the object drops (the
//   episode ends)
// e: angle from the object's x axis, projected on the horizontal plane, to the goal. The axis has
// no sense: e lies in [-90°, 90°).
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "tasks/catalogue/in_hand_gait.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere {
namespace {

constexpr std::size_t kFingers = InHandGait::kFingers, kAngles = InHandGait::kAngles,
                      kAction = InHandGait::kAction;
constexpr int kActions = 7;  // with the grip before them 10 s
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kGoals = 60 * kDegree, kStarts = 45 * kDegree;  // largest goal and start
constexpr double kNear = 10 * kDegree, kUnit = 30 * kDegree;     // of success, of the reward
constexpr double kEncoder = 0.01;    // deviation of a measured angle: encoder and play [rad]
constexpr double kEnd = 10;          // reward at the end
constexpr double kDropped = -0.025;  // height of a dropped object, from its place [m]
constexpr int kCloseFrom = 10, kCloseTo = 70, kLeaveFrom = 100, kLeaveTo = 150;  // of the grip
constexpr double kGone = -0.08;  // target of the stand when it has left [m]
// Constants of the script: turn of the object at turn = 1 [rad]; height at which it holds the
// object, and by which the object sinks in an action [m].
constexpr double kTurns = 0.42, kKept = -3e-3, kLost = 2.5e-3;
// Task state: the goal [rad], the Phase.
constexpr std::size_t kGoal = 0, kPhase = 1;
enum class Phase { settling, gripping, turning };

class InHand : public Task {
 public:
  InHand(const Scene& scene, InHandObservation observation)
      : Task(scene, declare_in_hand(observation)),
        observation_(observation),
        gait_(model().scene(), "object"),
        finger_(coordinate("swing_1")),
        object_(coordinate("object")),
        object_v_(dof("object")) {
    const Scene& s = model().scene();
    check_joints(s);
    if (s.motors.size() != kAngles + 1 || s.sensors.size() != kFingers)
      throw InputError(s.path + ": in_hand needs twelve motors of fingers, one of the stand, and " +
                       "four tactile sensors");
    for (const SensorInfo& sensor : model().sensors())
      if (sensor.points != kTaxels)
        throw InputError(s.path + ": in_hand needs " + std::to_string(kTaxels) +
                         " points on each tactile sensor; '" + sensor.name + "' has " +
                         std::to_string(sensor.points));
  }

  /// The fingers start open. The object starts turned, above a stand, on which it settles.
  void start(const TaskStart& s) const override {
    gait_.closing(0, s.q.subspan(finger_, kAngles));
    const double half = task_uniform(s.seed, s.episode, 0, 0, -kStarts, kStarts) / 2;
    const std::array<double, 4> turned{std::cos(half), 0, 0, std::sin(half)};
    std::copy(turned.begin(), turned.end(), &s.q[object_ + 3]);
    s.task_state[kGoal] = task_uniform(s.seed, s.episode, 0, 1, -kGoals, kGoals);
  }

  void begin_action(const TaskView&, std::span<double> memory) const override {
    memory[kPhase] = memory[kPhase] < 0.5 ? 1 : 2;
  }
  void begin_action_vjp(const TaskView&, std::span<double> memory,
                        const ViewCotangent&) const override {
    memory[kPhase] = 0;  // a count
  }

  void controls(const TaskView& view, int step, std::span<double> u) const override {
    const Phase phase = phase_of(view);
    if (phase == Phase::turning) {
      u[kAngles] = kGone;
      return gait_.targets(view.action, step, u.first(kAngles));
    }
    const bool grips = phase == Phase::gripping;
    u[kAngles] = grips ? kGone * share(step, kLeaveFrom, kLeaveTo) : 0;
    gait_.closing(grips ? share(step, kCloseFrom, kCloseTo) : 0, u.first(kAngles));
  }

  void controls_vjp(const TaskView& view, int step, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    if (phase_of(view) == Phase::turning)
      gait_.targets_vjp(view.action, step, weight.first(kAngles), out.action);
  }

  void observe(const TaskView& view, std::span<double> o) const override {
    const Snapshot& now = view.now();
    for (std::size_t k = 0; k < kAngles; ++k)
      o[k] = now.q[finger_ + k] + task_normal(view.seed, view.episode, 1 + view.actions,
                                              static_cast<std::uint32_t>(k), kEncoder);
    o[kAngles] = view.task_state[kGoal];
    if (observation_ == InHandObservation::blind) return;
    std::copy(now.tactile.begin(), now.tactile.end(), o.begin() + kAngles + 1);
  }

  void observe_vjp(const TaskView&, std::span<const double> weight,
                   const ViewCotangent& out) const override {
    // Every joint of a finger turns about one axis: coordinates and dofs have the same places.
    const SnapshotCotangent& to = out.snapshots.back();
    for (std::size_t k = 0; k < kAngles; ++k) to.q[finger_ + k] += weight[k];
    out.task_state[kGoal] += weight[kAngles];
    if (observation_ == InHandObservation::blind) return;
    for (std::size_t i = 0; i < to.tactile.size(); ++i) to.tactile[i] += weight[kAngles + 1 + i];
  }

  StepOutcome evaluate(const TaskView& view) const override {
    if (height(view.now()) < kDropped) return {-kEnd, true, false};
    const double e = to_goal(view);
    const bool there = view.actions == kActions && std::abs(e) < kNear;
    return {(there ? kEnd : 0) - e * e / (kUnit * kUnit), false, there};
  }

  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    if (height(view.now()) < kDropped) return;
    const double e_bar = -2 * weight * to_goal(view) / (kUnit * kUnit);
    out.task_state[kGoal] += e_bar;
    // δR = R [θ]: the x axis r₀ changes by θ_z r₁ - θ_y r₂, with the y and z axes r₁ and r₂.
    const Axes r = axes(view.now());
    const double square = r[0][0] * r[0][0] + r[0][1] * r[0][1];
    const auto turned = [&](const std::array<double, 2>& by) {
      return (r[0][0] * by[1] - r[0][1] * by[0]) / square;
    };
    out.snapshots.back().q[object_v_ + 4] += e_bar * turned(r[2]);
    out.snapshots.back().q[object_v_ + 5] -= e_bar * turned(r[1]);
  }

  /// Feeds back the object's turn and height, whatever the task observes.
  void scripted(const TaskView& view, std::span<const double>,
                std::span<double> action) const override {
    action[0] = std::clamp(to_goal(view) / kTurns, -1.0, 1.0);
    action[1] = std::clamp((kLost + kKept - height(view.now())) / InHandGait::kLift, -1.0, 1.0);
    action[2] = action[3] = 0;
  }

 private:
  static constexpr std::size_t kTaxels = 64;

  /// Throws InputError unless the fingers' motors come finger by finger and the stand's last, every
  /// finger's joint turns about one axis, and the object moves freely.
  static void check_joints(const Scene& s) {
    const auto joint = [&](const std::string& name) -> const JointDescription& {
      for (const LinkDescription& link : s.links)
        if (link.joint.name == name) return link.joint;
      throw InputError(s.path + ": in_hand needs a joint '" + name + "'");
    };
    for (std::size_t k = 0; k <= kAngles; ++k) {
      const std::string name = k == kAngles ? "stand"
                                            : std::array{"swing_", "upper_", "lower_"}[k % 3] +
                                                  std::to_string(k / 3 + 1);
      const JointDescription& at = joint(name);
      if (at.type != (k == kAngles ? JointType::prismatic : JointType::revolute))
        throw InputError(at.source.prefix() + "in_hand: joint '" + name + "' must be " +
                         (k == kAngles ? "prismatic" : "revolute"));
      if (k < s.motors.size() && s.motors[k].joint != name)
        throw InputError(s.motors[k].source.prefix() + "in_hand: motor " + std::to_string(k + 1) +
                         " is that of joint '" + s.motors[k].joint + "'; expected '" + name + "'");
    }
    if (joint("object").type != JointType::free)
      throw InputError(joint("object").source.prefix() +
                       "in_hand: joint 'object' must be free3d: fingers turn and lift it");
  }
  /// Horizontal parts of the object's axes.
  using Axes = std::array<std::array<double, 2>, 3>;

  static Phase phase_of(const TaskView& view) {
    return static_cast<Phase>(std::lround(view.task_state[kPhase]));
  }
  static double share(int step, int from, int to) {
    return std::clamp(static_cast<double>(step - from) / (to - from), 0.0, 1.0);
  }
  [[nodiscard]] double height(const Snapshot& now) const { return now.q[object_ + 2]; }
  [[nodiscard]] Axes axes(const Snapshot& now) const {
    const double *const p = &now.q[object_ + 3], w = p[0], x = p[1], y = p[2], z = p[3];
    return {{{1 - 2 * (y * y + z * z), 2 * (x * y + w * z)},
             {2 * (x * y - w * z), 1 - 2 * (x * x + z * z)},
             {2 * (x * z + w * y), 2 * (y * z - w * x)}}};
  }
  /// Returns the angle from the object's x axis to the goal [rad].
  [[nodiscard]] double to_goal(const TaskView& view) const {
    const std::array<double, 2> along = axes(view.now())[0];
    const double off = view.task_state[kGoal] - std::atan2(along[1], along[0]);
    return off - std::numbers::pi * std::floor(off / std::numbers::pi + 0.5);
  }

  InHandObservation observation_;
  InHandGait gait_;
  std::size_t finger_, object_, object_v_;  // coordinates: the first of twelve, the object's; dof
};

}  // namespace

TaskSpec declare_in_hand(InHandObservation observation) {
  TaskSpec spec;
  spec.name = "in_hand";
  spec.summary = "Four fingers turn an egg in the hand by touch and the angles of their joints.";
  spec.success = "after 10 s the object's long axis is within 10 degrees of the goal";
  spec.scene = "in_hand.xml";
  spec.action = {
      "gait",
      {kAction},
      "1",
      "turn of the tips, times 0.35 rad; their rise, times 4 mm; force of fingers 1 and 3, of 2 "
      "and 4: 3 N and 1.5 N times it",
      {},
      -1,
      1};
  spec.observations = {{"angles",
                        {kAngles},
                        "rad",
                        "swing, upper and lower of each finger, with noise of 0.01 rad",
                        {0.5}},
                       {"goal", {1}, "rad", "where the object's long axis is to point", {0.5}}};
  spec.steps_per_action = InHandGait::kSteps;
  spec.control_every = 1;
  spec.snapshots = {InHandGait::kSteps};
  spec.horizon = kActions;
  spec.warm_up = true;
  spec.settling_steps = 60;
  spec.settling_timestep = 0.01;
  spec.task_state = 2;
  if (observation == InHandObservation::tactile) {
    spec.reads_tactile = true;
    spec.observations.push_back(
        {"tactile", {kFingers, 64, 3}, "N", "fields of the tips", {0.1, 0.1, 0.4}});
    spec.observations.back().touch = true;
  } else {
    spec.name += "_blind";
    spec.summary = "The same; angles and goal alone are observed.";
  }
  return spec;
}

std::unique_ptr<Task> make_in_hand(const Scene& scene, InHandObservation observation) {
  return std::make_unique<InHand>(scene, observation);
}

}  // namespace tangere
