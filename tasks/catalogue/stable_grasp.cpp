// SPDX-License-Identifier: Apache-2.0
// Stable grasp: find where to lift a bar of unknown densities without tilting it (Xu et al., second
// experiment). A grasp is 180 targets of the hand: close, hold, lift, hold, lower, hold, open. Held
// at its centre of mass, the lifted bar stays level. Held elsewhere, it turns about the grip, and
// the pads read the turning as a vortex of shear.
//   reward = 100 if |tilt| < 0.02 rad and the bar is lifted by 5 mm after step 60 (the episode
//   ends),
//       else -10 |tilt|
// tilt = asin(e_z · R e_y), R: orientation of the bar.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "engine/sense/flow_map.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere {
namespace {

constexpr int kBlocks = 11, kRows = 13, kCols = 10, kPads = 2;
constexpr int kSteps = 180, kFirstSnapshot = 60, kGrasps = 10;
constexpr double kReach = 0.05, kFarthest = 0.11;  // reach of an action and of the hand [m]
constexpr double kLevel = 0.02, kLifted = 5e-3;    // [rad], [m]
constexpr double kSuccess = 100, kTilt = 10;       // of the reward
constexpr double kOpen = -0.025, kClosed = 0, kHeight = 0.03;  // targets of fingers and hand [m]
constexpr double kTooLittle = 1e-6;                            // less shear counts as none [N]
// Task state: position of the grasp and of the one before [m], height of the bar at rest [m].
constexpr std::size_t kPlace = 0, kBefore = 1, kRest = 2;

/// 0 before step `from`, 1 from step `from + length` on, linear in between.
double ramp(int step, int from, int length) {
  return std::clamp(static_cast<double>(step + 1 - from) / length, 0.0, 1.0);
}

/// Returns the scene with the density of each block as its varying numbers.
Scene with_densities(Scene scene) {
  scene.randomizations.clear();
  for (int b = 0; b < kBlocks; ++b) {
    RandomizationDescription d;
    d.number = {NumberOwner::body, NumberField::density, "block_" + std::to_string(b)};
    d.distribution.kind = Distribution::Kind::list;
    d.distribution.values = {500};  // replaced at the start of an episode
    scene.randomizations.push_back(d);
  }
  return scene;
}

class StableGrasp : public Task {
 public:
  StableGrasp(const Scene& scene, Friction friction)
      : Task(with_densities(scene), declare_stable_grasp(friction)),
        hand_(coordinate("hand_slide")),
        bar_(coordinate("bar")),
        bar_v_(dof("bar")),
        script_(friction == Friction::gel       ? kGel
                : friction == Friction::elastic ? kElastic
                                                : kViscous) {
    for (const SensorInfo& sensor : model().sensors())
      if (model().sensors().size() != kPads || sensor.rows != kRows || sensor.cols != kCols)
        throw InputError(model().scene().path + ": stable grasp needs two pads of 13 × 10 points");
  }

  /// Draws densities that balance at `centre`, measured in blocks from the bar's right end. The
  /// density of the block at the centre is drawn, and so is the sum of all. The two sides share the
  /// rest so that their moments about `centre` are equal. Random shares divide it among the blocks
  /// of a side.
  void start(const TaskStart& s) const override {
    std::uint32_t next = 0;
    const auto number = [&](double low, double high) {
      return task_uniform(s.seed, s.episode, 0, next++, low, high);
    };
    const double centre = number(1, kBlocks - 1), density = number(600, 700),
                 sum = number(3000, 7000);
    const int middle = static_cast<int>(centre);
    const double offset = centre - (middle + 0.5);
    std::array<double, kBlocks> share{};
    std::array<double, 2> total{}, arm{};  // right, left
    for (int b = 0; b < kBlocks; ++b) {
      share[static_cast<std::size_t>(b)] = b == middle ? 0 : number(0, 1) + 0.1;
      total[b > middle] += share[static_cast<std::size_t>(b)];
    }
    for (int b = 0; b < kBlocks; ++b)
      if (b != middle)
        arm[b > middle] +=
            share[static_cast<std::size_t>(b)] / total[b > middle] * std::abs(b + 0.5 - centre);
    const double sides = sum - density;
    const double right = (sides * arm[1] - density * offset) / (arm[0] + arm[1]);
    for (int b = 0; b < kBlocks; ++b) {
      const double side = b > middle ? sides - right : right;
      s.varying[static_cast<std::size_t>(b)] =
          b == middle ? density : side * share[static_cast<std::size_t>(b)] / total[b > middle];
    }
    s.q[hand_ + 1] = 0;  // the first grasp is at the middle
  }

  void begin_action(const TaskView& view, std::span<double> memory) const override {
    if (view.actions == 0) memory[kRest] = view.now().q[bar_ + 2];
    memory[kBefore] = memory[kPlace];
    memory[kPlace] = place(view);
  }

  /// Controls: hand x, y, z, turn; fingers. The hand is above its place before the fingers touch.
  void controls(const TaskView& view, int step, std::span<double> u) const override {
    const double moved = ramp(step, 0, 10), closed = ramp(step, 10, 10) - ramp(step, 160, 20);
    u[0] = u[3] = 0;
    u[1] = view.task_state[kBefore] + moved * (place(view) - view.task_state[kBefore]);
    u[2] = kHeight * (ramp(step, 30, 50) - ramp(step, 100, 50));
    u[4] = u[5] = kOpen + closed * (kClosed - kOpen);
  }

  void observe(const TaskView& view, std::span<double> o) const override {
    const std::span<const double> field = view.snapshots.front().tactile;
    const std::array<ShearField<double>, kPads> pads{
        ShearField<double>{field.first(field.size() / 2)},
        ShearField<double>{field.subspan(field.size() / 2)}};
    std::array<double, std::size_t{kPads} * kRows * kCols * 2> flow{};
    normalised_flow(pads, flow, kTooLittle);
    constexpr std::size_t kPoints = std::size_t{kRows} * kCols;
    for (std::size_t pad = 0; pad < kPads; ++pad)
      for (std::size_t p = 0; p < kPoints; ++p)
        for (std::size_t c = 0; c < 2; ++c)
          o[(2 * pad + c) * kPoints + p] = flow[(pad * kPoints + p) * 2 + c];
  }

  /// The threshold of the normalisation only chooses between a flow and none.
  void observe_vjp(const TaskView& view, std::span<const double> weight,
                   const ViewCotangent& out) const override {
    const std::span<const double> field = view.snapshots.front().tactile;
    const std::span<double> to = out.snapshots.front().tactile;
    const std::array<ShearField<double>, kPads> pads{
        ShearField<double>{field.first(field.size() / 2)},
        ShearField<double>{field.subspan(field.size() / 2)}};
    const std::array<ShearCotangent, kPads> pads_bar{ShearCotangent{to.first(to.size() / 2), {}},
                                                     ShearCotangent{to.subspan(to.size() / 2), {}}};
    std::array<double, std::size_t{kPads} * kRows * kCols * 2> flow_bar{};
    constexpr std::size_t kPoints = std::size_t{kRows} * kCols;
    for (std::size_t pad = 0; pad < kPads; ++pad)
      for (std::size_t p = 0; p < kPoints; ++p)
        for (std::size_t c = 0; c < 2; ++c)
          flow_bar[(pad * kPoints + p) * 2 + c] = weight[(2 * pad + c) * kPoints + p];
    normalised_flow_vjp(pads, flow_bar, pads_bar, kTooLittle);
  }

  StepOutcome evaluate(const TaskView& view) const override {
    const double tilt = std::abs(std::asin(slope(lifted(view))));
    const bool level = tilt < kLevel && lifted(view).q[bar_ + 2] - view.task_state[kRest] > kLifted;
    return {level ? kSuccess : -kTilt * tilt, level, level};
  }

  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    if (evaluate(view).success) return;
    // δR = R [θ]: δ(e_z · R e_y) = R_zz θ_x - R_zx θ_z.
    const double* const r = &lifted(view).q[bar_ + 3];
    const double zx = 2 * (r[1] * r[3] - r[0] * r[2]), zz = 1 - 2 * (r[1] * r[1] + r[2] * r[2]);
    const double at = slope(lifted(view));
    const double slope_bar = -weight * kTilt * (at < 0 ? -1 : 1) / std::sqrt(1 - at * at);
    out.snapshots.front().q[bar_v_ + 3] += slope_bar * zz;
    out.snapshots.front().q[bar_v_ + 5] -= slope_bar * zx;
  }

  void controls_vjp(const TaskView& view, int step, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    const double moved = ramp(step, 0, 10);
    const bool within = within_reach(view.task_state[kBefore], view.action[0]);
    out.task_state[kBefore] += weight[1] * (within ? 1 : 1 - moved);
    if (within) out.action[0] += weight[1] * moved * kReach;
  }

  void begin_action_vjp(const TaskView& view, std::span<double> memory,
                        const ViewCotangent& out) const override {
    if (view.actions == 0) out.snapshots.back().q[bar_v_ + 2] += std::exchange(memory[kRest], 0.0);
    const double place_bar =
        within_reach(view.task_state[kPlace], view.action[0]) ? memory[kPlace] : 0;
    out.action[0] += place_bar * kReach;
    memory[kPlace] = place_bar + std::exchange(memory[kBefore], 0.0);
  }

  /// Moves towards the heavier side. The bar slides and turns in the grip at rates proportional to
  /// its weight and its moment, and shear is proportional to a point's velocity. With v downward
  /// and ω about the grip, the centre of mass is ω/v Σ r²/n away, the mean over the points that
  /// hold the bar. Springs and gels show how far it has slid and turned in the same way.
  void scripted(const TaskView&, std::span<const double> o,
                std::span<double> action) const override {
    double weight = 0, moment = 0, square = 0;
    for (std::size_t pad = 0; pad < kPads; ++pad) {
      const double up =
          pad == 0 ? 1
                   : -1;  // rows of the left pad go up, those of the right pad down; columns to -y
      for (std::size_t i = 0; i < kRows; ++i)
        for (std::size_t j = 0; j < kCols; ++j) {
          const std::size_t at = 2 * pad * kRows * kCols + i * kCols + j;
          const double fz = up * o[at], fy = -o[at + std::size_t{kRows} * kCols];
          const double z = up * (static_cast<double>(i) - 6) * script_.pitch,
                       y = (4.5 - static_cast<double>(j)) * script_.pitch;
          weight += fz;
          moment += y * fz - z * fy;
          square += y * y + z * z;
        }
    }
    constexpr double kPoints = kPads * kRows * kCols;
    const double away = moment / square / (weight / kPoints) * script_.mean_square;
    action[0] = std::isfinite(away) ? std::clamp(script_.gain * away / kReach, -1.0, 1.0) : 0;
  }

 private:
  struct Script {
    double pitch;        ///< distance between neighbouring points of a pad [m]
    double mean_square;  ///< of r over the points of a pad that hold the bar [m²]
    double gain;         ///< share of the distance that the script moves
  };
  // The 33 contact points of a pad hold the bar; a gel holds it with those that it senses. The
  // gain of springs is from a search; larger ones overshoot.
  static constexpr double kContactPoints = 0.4545 * 0.018 * 0.018,
                          kGelPoints = 2e-3 * 2e-3 * (kRows * kRows + kCols * kCols - 2) / 12;
  static constexpr Script kViscous{1.5e-3, kContactPoints, 1},
      kElastic{1.5e-3, kContactPoints, 0.4}, kGel{2e-3, kGelPoints, 1};

  /// Where the current action grasps [m].
  static double place(const TaskView& view) {
    return std::clamp(view.task_state[kBefore] + kReach * view.action[0], -kFarthest, kFarthest);
  }
  static bool within_reach(double before, double action) {
    return std::abs(before + kReach * action) <= kFarthest;
  }
  static const Snapshot& lifted(const TaskView& view) { return view.snapshots.front(); }
  /// Returns e_z · R e_y.
  [[nodiscard]] double slope(const Snapshot& m) const {
    const double* const r = &m.q[bar_ + 3];
    return std::clamp(2 * (r[2] * r[3] + r[0] * r[1]), -1.0, 1.0);
  }

  std::size_t hand_, bar_, bar_v_;
  Script script_;
};

}  // namespace

TaskSpec declare_stable_grasp(Friction friction) {
  TaskSpec spec;
  spec.name = "stable_grasp";
  spec.summary =
      "A gripper looks for the place where a bar of unknown densities can be lifted level.";
  spec.scene = "stable_grasp.xml";
  spec.success = "lifted by more than 5 mm with a tilt below 0.02 rad";
  spec.action = {
      "shift", {1}, "1", "how far the next grasp is from this one along the bar, times 50 mm",
      {},      -1,  1};
  spec.observations = {
      {"flow",
       {4, 13, 10},
       "1",
       "normalised shear while lifting: left pad up and to -y, right pad down and to -y",
       {},
       -1,
       1}};
  spec.observations.back().touch = true;
  spec.steps_per_action = kSteps;
  spec.control_every = 1;
  spec.snapshots = {kFirstSnapshot, kSteps};
  spec.horizon = kGrasps - 1;
  spec.warm_up = true;
  spec.settling_steps = 50;
  spec.settling_timestep = 0.05;
  spec.task_state = 3;
  spec.reads_tactile = true;
  return with_friction(std::move(spec), friction);
}

std::unique_ptr<Task> make_stable_grasp(const Scene& scene, Friction friction) {
  return std::make_unique<StableGrasp>(scene, friction);
}

}  // namespace tangere
