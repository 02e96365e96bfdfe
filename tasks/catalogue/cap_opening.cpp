// SPDX-License-Identifier: Apache-2.0
// Cap opening: three fingers turn a cap by an eighth of a turn. Its damping, radius and position
// are not observed (Xu et al., fourth experiment).
//   reward = -0.5 for each finger that does not touch - min(θ - π/4, 0)² - 0.005 |a|²,
//   +50 if θ > π/4 (the episode ends), -50 if a fingertip is above 50 mm (the episode ends)
// θ: angle of the cap. a: the action; the target of each angle is the angle plus 0.06 rad times a.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "engine/scene/scene_number.hpp"
#include "tasks/catalogue/cap_opening_script.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere {
namespace {

constexpr std::size_t kFingers = 3, kAngles = 9, kPoints = 302, kField = 3 * kPoints;
constexpr int kSide = 20;  // pixels along a side of an image
constexpr int kActions = 200;
constexpr double kStep = 0.06;                  // change of a target at a = 1 [rad]
constexpr double kOpen = std::numbers::pi / 4;  // [rad]
constexpr double kHighest = 0.05;               // upper limit of a fingertip's height [m]
constexpr double kIdle = 0.5, kEffort = 0.005, kEnd = 50;  // weights of the reward
constexpr FingerAngles kStart{0, -0.5, 0.8};               // [rad]
constexpr double kSpread = 0.05;                           // spread of the start angles [rad]
constexpr double kSmallest = 0.02, kLargest = 0.08;        // radius of the cap [m]
constexpr double kOffset = 0.02;  // largest offset of its axis, along x and y [m]
constexpr double kLeast = 1e-3;   // least distance of a tip from the cap at the start [m]

/// Returns the scene with the cap's damping, radius and position as its varying parameters, in this
/// order. The task draws their values.
Scene with_cap_varying(Scene scene) {
  std::erase_if(scene.randomizations, [](const RandomizationDescription& d) {
    const bool starts_or_stands = is_of_start(d.number) || d.number.field == NumberField::pos;
    return d.number.owner != NumberOwner::joint || starts_or_stands;
  });
  const auto vary = [&](const SceneNumber& number, double low, double high) {
    RandomizationDescription d;
    d.number = number;
    d.distribution.a = low;
    d.distribution.b = high;
    scene.randomizations.push_back(d);
  };
  vary({NumberOwner::body, NumberField::radius, "cap"}, kSmallest, kLargest);
  for (const int axis : {0, 1})
    vary({NumberOwner::joint, NumberField::pos, "cap", axis}, -kOffset, kOffset);
  return scene;
}

class CapOpening : public Task {
 public:
  CapOpening(const Scene& scene, CapObservation observation, Friction friction)
      : Task(with_cap_varying(scene), declare_cap_opening(observation, friction)),
        observation_(observation),
        cap_(coordinate("cap")),
        finger_(coordinate("swing_1")),
        script_(model().scene()) {
    const Scene& s = model().scene();
    if (model().end_effectors().size() != kFingers || s.sensors.size() != kFingers ||
        s.motors.size() != kAngles)
      throw InputError(
          s.path +
          ": cap opening needs nine motors, three end effectors and three tactile sensors");
    for (const TactileDescription& tip : s.sensors) draw(tip, s.path);
    if (script_.gap(kStart, {kLargest, kOffset, kOffset}) < kLeast)
      throw InputError(s.path + ": the fingers of cap opening would start in the cap");
    for (std::size_t k = 0; k < kAngles; ++k)
      for (const LinkDescription& link : s.links)
        if (link.joint.name == s.motors[k].joint)
          limits_[k] = link.joint.limits.value_or(limits_[k]);
  }

  /// Draws every angle. Draws a finger again if it would begin inside the cap.
  void start(const TaskStart& s) const override {
    std::copy_n(s.varying.end() - 3, 3, s.task_state.begin() + kFingers);
    std::uint32_t drawn = 0;
    for (std::size_t f = 0; f < kFingers; ++f) {
      FingerAngles q{};
      do {
        for (std::size_t k = 0; k < q.size(); ++k)
          q[k] = kStart[k] + task_normal(s.seed, s.episode, 0, drawn++, kSpread);
      } while (script_.gap(q, cap(s.task_state, f)) < kLeast);
      std::copy(q.begin(), q.end(),
                s.q.begin() + static_cast<std::ptrdiff_t>(finger_ + f * q.size()));
    }
  }

  /// The task state is used by the script: which fingers press, then radius and position of the
  /// cap.
  void begin_action(const TaskView& view, std::span<double> memory) const override {
    for (std::size_t f = 0; f < kFingers; ++f)
      memory[f] = script_.presses(angles(view, f), cap(memory, f), memory[f] != 0) ? 1 : 0;
  }
  void begin_action_vjp(const TaskView&, std::span<double> memory,
                        const ViewCotangent&) const override {
    std::fill_n(memory.begin(), kFingers, 0.0);  // flags: 1 if the finger presses
  }

  void controls(const TaskView& view, int, std::span<double> u) const override {
    for (std::size_t k = 0; k < kAngles; ++k)
      u[k] = std::clamp(target(view, k), limits_[k][0], limits_[k][1]);
  }

  void observe(const TaskView& view, std::span<double> o) const override {
    const Snapshot& now = view.now();
    for (std::size_t k = 0; k < kAngles; ++k) o[k] = now.q[finger_ + k];
    std::copy(now.end_effectors.begin(), now.end_effectors.end(), o.begin() + kAngles);
    if (observation_ == CapObservation::blind) return;
    const std::span<double> images = o.subspan(2 * kAngles);
    std::fill(images.begin(), images.end(), 0.0);
    for (std::size_t p = 0; p < pixel_.size(); ++p)
      std::copy_n(&now.tactile[3 * p], 3, &images[3 * pixel_[p]]);
  }

  void observe_vjp(const TaskView&, std::span<const double> weight,
                   const ViewCotangent& out) const override {
    // Every joint here turns about one axis: coordinates and dofs have the same places.
    const SnapshotCotangent& to = out.snapshots.back();
    for (std::size_t k = 0; k < kAngles; ++k) {
      to.q[finger_ + k] += weight[k];
      to.end_effectors[k] += weight[kAngles + k];  // three fingertips of three coordinates
    }
    if (observation_ == CapObservation::blind) return;
    const std::span<const double> images = weight.subspan(2 * kAngles);
    for (std::size_t p = 0; p < pixel_.size(); ++p)
      for (std::size_t c = 0; c < 3; ++c) to.tactile[3 * p + c] += images[3 * pixel_[p] + c];
  }

  StepOutcome evaluate(const TaskView& view) const override {
    double reward = 0;
    for (std::size_t f = 0; f < kFingers; ++f) reward -= touches(view.now(), f) ? 0 : kIdle;
    const double missing = std::min(view.now().q[cap_] - kOpen, 0.0);
    reward -= missing * missing;
    for (const double a : view.action) reward -= kEffort * a * a;
    if (left(view.now())) return {reward - kEnd, true, false};
    if (view.now().q[cap_] > kOpen) return {reward + kEnd, true, true};
    return {reward, false, false};
  }

  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    // Every joint here turns about one axis: coordinates and dofs have the same places.
    out.snapshots.back().q[cap_] -= weight * 2 * std::min(view.now().q[cap_] - kOpen, 0.0);
    for (std::size_t k = 0; k < kAngles; ++k)
      out.action[k] -= weight * 2 * kEffort * view.action[k];
  }

  void controls_vjp(const TaskView& view, int, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < kAngles; ++k) {
      const double to = target(view, k);
      if (to < limits_[k][0] || to > limits_[k][1]) continue;
      out.action[k] += weight[k] * kStep;
      out.snapshots.back().q[finger_ + k] += weight[k];
    }
  }

  /// Feeds back the state, whatever the task observes.
  void scripted(const TaskView& view, std::span<const double>,
                std::span<double> action) const override {
    for (std::size_t f = 0; f < kFingers; ++f) {
      const FingerAngles q = angles(view, f),
                         to = script_.targets(q, cap(view.task_state, f), view.task_state[f] != 0);
      for (std::size_t k = 0; k < q.size(); ++k)
        action[f * q.size() + k] = std::clamp((to[k] - q[k]) / kStep, -1.0, 1.0);
    }
  }

 private:
  /// Assigns the points of the next tip to pixels of the images, as the scene says.
  void draw(const TactileDescription& tip, const std::string& path) {
    const std::size_t image = pixel_.size() / kPoints * std::size_t{kSide} * kSide;
    bool fits = tip.points.size() == kPoints;
    for (std::size_t p = 0; p < kPoints && fits; ++p) {
      const std::array<int, 2>& at = tip.points[p].pixel;
      pixel_.push_back(image + std::size_t(at[0]) * kSide + std::size_t(at[1]));
      fits = std::min(at[0], at[1]) >= 0 && std::max(at[0], at[1]) < kSide &&
             std::find(pixel_.begin(), pixel_.end() - 1, pixel_.back()) == pixel_.end() - 1;
    }
    if (!fits)
      throw InputError(
          fmt::format("{}: tactile sensor '{}'; cap opening needs {} points, each with a pixel of "
                      "its own of {} × {}",
                      path, tip.name, kPoints, kSide, kSide));
  }
  /// Returns the cap in a finger's frame. The fingers are 120° apart.
  static CapView cap(std::span<const double> memory, std::size_t finger) {
    const double turn = 2 * std::numbers::pi / kFingers * static_cast<double>(finger),
                 c = std::cos(turn), s = std::sin(turn);
    const double x = memory[kFingers + 1], y = memory[kFingers + 2];
    return {memory[kFingers], c * x + s * y, c * y - s * x};
  }
  [[nodiscard]] FingerAngles angles(const TaskView& view, std::size_t finger) const {
    const double* const q = &view.now().q[finger_ + 3 * finger];
    return {q[0], q[1], q[2]};
  }
  /// Target of an angle, before its limits apply.
  [[nodiscard]] double target(const TaskView& view, std::size_t k) const {
    return view.now().q[finger_ + k] + kStep * view.action[k];
  }
  /// A field is exactly zero where nothing touches.
  static bool touches(const Snapshot& m, std::size_t finger) {
    const std::span<const double> field = m.tactile.subspan(finger * kField, kField);
    return std::any_of(field.begin(), field.end(), [](double force) { return force != 0; });
  }
  static bool left(const Snapshot& m) {
    for (std::size_t f = 0; f < kFingers; ++f)
      if (m.end_effectors[3 * f + 2] > kHighest) return true;
    return false;
  }

  CapObservation observation_;
  std::vector<std::size_t> pixel_;  // for each point of the field, its pixel among all images
  std::size_t cap_, finger_;        // coordinates: the cap's, the first of nine in a row
  std::array<std::array<double, 2>, kAngles> limits_ = [] {
    std::array<std::array<double, 2>, kAngles> none{};
    none.fill({-TensorSpec::kUnbounded, TensorSpec::kUnbounded});
    return none;
  }();
  CapScript script_;
};

}  // namespace

TaskSpec declare_cap_opening(CapObservation observation, Friction friction) {
  TaskSpec spec;
  spec.name = "cap_opening";
  spec.summary =
      "Three fingers turn a cap by 45 degrees; angles, fingertips and what they feel, as images, "
      "are observed.";
  spec.scene = "cap_opening.xml";
  spec.success = "the cap is turned by more than 45 degrees";
  spec.action = {"step", {kAngles}, "1", "of every angle's target from the angle, times 0.06 rad",
                 {},     -1,        1};
  spec.observations = {{"angles", {kAngles}, "rad", "swing, upper and lower of each finger", {0.5}},
                       {"tips", {kFingers, 3}, "m", "middles of the fingertips' spheres", {0.05}}};
  spec.steps_per_action = 5;
  spec.snapshots = {5};
  spec.horizon = kActions;
  spec.task_state = kFingers + 3;
  spec.reads_end_effectors = true;
  spec.reads_tactile = true;  // the reward depends on touching fingers
  if (observation == CapObservation::tactile) {
    spec.observations.push_back(
        {"tactile",
         {kFingers, kSide, kSide, 3},
         "N",
         "fields of the tips: rows up, columns to the left, zero where no point is",
         {0.1, 0.1, 0.4}});
    spec.observations.back().touch = true;
  } else {
    spec.name = "cap_opening_blind";
    spec.summary = "The same; angles and fingertips alone are observed.";
  }
  return with_friction(std::move(spec), friction);
}

std::unique_ptr<Task> make_cap_opening(const Scene& scene, CapObservation observation,
                                       Friction friction) {
  return std::make_unique<CapOpening>(scene, observation, friction);
}

}  // namespace tangere
