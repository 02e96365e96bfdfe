// SPDX-License-Identifier: Apache-2.0
// Insertion: the hand lowers a box onto a hole with a pose error. The pads read the impact on the
// rim, and the policy corrects the pose (Xu et al., fifth experiment). Every attempt restarts above
// the hole with the error e = (x, y, yaw), which the action changes.
//   reward = 10 if the box is in the hole (the episode ends), else -|e_xy|²/(6 mm)² - (e_yaw/10°)²
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "engine/scene/scene_number.hpp"
#include "engine/sense/flow_map.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere {
namespace {

constexpr int kSteps = 45, kAttempts = 15;
constexpr std::size_t kRows = 13, kCols = 10, kPads = 2, kPoints = kRows * kCols;
constexpr double kDegree = std::numbers::pi / 180;
constexpr std::array<double, 3> kAct{0.02, 0.02,
                                     10 * kDegree};  // of an action, at most [m, m, rad]
constexpr std::array<double, 3> kOff{6e-3, 6e-3, 10 * kDegree};  // largest e at the start
constexpr double kInside = 0.0247;  // height of the box's lower corners [m]
// Half the inner size of the hole [m]: a box whose middle is farther off fell beside the walls.
constexpr std::array<double, 2> kHole{0.01975, 0.02725};
constexpr double kSuccess = 10, kNoise = 1e-5,
                 kTooLittle = 1e-4;  // reward; noise of a reading, least shear [N]
constexpr double kShift = 4.1e-3,
                 kTurn = 5 * kDegree;  // steps of the script: a mean e that misses
constexpr double kApartNoise = 0.01, kTurningNoise = 0.04;  // smaller readings are noise
constexpr int kPatience = 3;  // attempts between turns of the script, at least
// A skin with ks (docs/skin.md): ks over kn, its time of relaxation [s], and the depth at which the
// normal damping relaxes in this time [m].
constexpr double kLeastShare = 0.25, kLargestShare = 0.67, kRelaxation = 5e-3, kDepth = 3e-4;
constexpr double kLift = 6e-3;  // targets start this far above the grip, end as far below [m]
// Task state: e before the current action, e in it, height of the grip [m], gripping force as a
// share of 20 N, sum of the yaw of actions [rad], for the script.
constexpr std::size_t kBefore = 0, kNow = 3, kHeight = 6, kGrip = 7, kTurned = 8;

constexpr int kSkinNumbers = kPointCoefficients + 1;  // kn, kt, mu, damping, ks

/// Those of points with this stiffness and friction whose shear is `share` as stiff.
std::array<double, kSkinNumbers> elastic_skin(double kn, double mu, double share) {
  return {kn, share * kn * kRelaxation, mu, kn * kRelaxation / kDepth, share * kn};
}

/// Returns the scene with the unknown coefficients of the skin as its varying numbers, equal for
/// both pads: those of the paper, or all. A gel has the material of its scene.
Scene with_skin(Scene scene, Friction friction) {
  scene.randomizations.clear();
  if (friction == Friction::gel) return scene;
  const auto vary = [&](const SceneNumber& number) {
    RandomizationDescription d;
    d.number = number;
    d.distribution.kind = Distribution::Kind::list;
    d.distribution.values = {1};  // replaced at the start of an episode
    scene.randomizations.push_back(d);
  };
  for (const char* pad : {"left_pad", "right_pad"}) {
    const bool elastic = friction == Friction::elastic;
    for (int k = 0; k < (elastic ? kSkinNumbers : 3); ++k)
      vary({NumberOwner::contact, coefficient_field(k), pad, 0, "box"});
    for (int k = 0; k < (elastic ? kSkinNumbers : kPointCoefficients); ++k)
      vary({NumberOwner::tactile, coefficient_field(k), pad});
  }
  return scene;
}

class Insertion : public Task {
 public:
  Insertion(const Scene& scene, InsertionMotion motion, Friction friction)
      : Task(with_skin(scene, friction), declare_insertion(motion, friction)),
        friction_(friction),
        moved_(motion == InsertionMotion::rotation      ? std::vector<std::size_t>{2}
               : motion == InsertionMotion::translation ? std::vector<std::size_t>{0, 1}
                                                        : std::vector<std::size_t>{0, 1, 2}),
        hand_(coordinate("hand_slide")),
        turn_(coordinate("hand_turn")),
        finger_(coordinate("left_finger")),
        box_(coordinate("box")),
        hand_v_(dof("hand_slide")),
        turn_v_(dof("hand_turn")),
        box_v_(dof("box")) {
    for (const LinkDescription& link : model().scene().links)
      if (link.joint.name == "box") rest_ = link.joint.pose.position;
    if (model().sensors().size() != kPads ||
        static_cast<std::size_t>(model().sensors()[0].points) != kPoints)
      throw InputError(model().scene().path + ": insertion needs two pads of 13 × 10 points");
  }

  void start(const TaskStart& s) const override {
    const auto number = [&](std::uint32_t k, double low, double high) {
      return task_uniform(s.seed, s.episode, 0, k, low, high);
    };
    for (const std::size_t k : moved_)
      s.task_state[kBefore + k] = s.task_state[kNow + k] =
          number(static_cast<std::uint32_t>(k), -kOff[k], kOff[k]);
    s.task_state[kHeight] = number(3, -0.01, 5e-3);
    s.task_state[kGrip] = number(4, 0.125, 0.8);
    const double contact_kn = number(5, 2e3, 14e3), contact_mu = number(7, 0.5, 2.5);
    const double tactile_kn = number(8, 50, 450), tactile_mu = number(10, 0.5, 2.5);
    std::vector<double> skin{contact_kn,          number(6, 20, 140), contact_mu,        tactile_kn,
                             number(9, 0.2, 2.3), tactile_mu,         number(11, 0, 100)};
    if (friction_ == Friction::elastic) {
      const double share = number(12, kLeastShare, kLargestShare);
      const auto contact = elastic_skin(contact_kn, contact_mu, share),
                 tactile = elastic_skin(tactile_kn, tactile_mu, share);
      skin.assign(contact.begin(), contact.end());
      skin.insert(skin.end(), tactile.begin(), tactile.end());
    }
    for (std::size_t k = 0; k < s.varying.size(); ++k) s.varying[k] = skin[k % skin.size()];
    hold({0, 0, 0, s.task_state, {}, {}}, s.q, s.v);
  }

  void begin_action(const TaskView& view, std::span<double> memory) const override {
    for (std::size_t k = 0; k < 3; ++k) memory[kBefore + k] = memory[kNow + k];
    const std::array<double, 3> e = off(view);
    memory[kTurned] += e[2] - memory[kBefore + 2];
    std::copy(e.begin(), e.end(), memory.begin() + kNow);
  }

  /// The box between open fingers, 3 mm above the rim.
  void restart_state(const TaskView& view, std::span<double> q,
                     std::span<double> v) const override {
    hold(view, q, v);
  }

  /// Controls: hand x, y, z, turn; fingers. The fingers close in five steps, then the hand
  /// descends.
  void controls(const TaskView& view, int step, std::span<double> u) const override {
    const std::array<double, 3> e = off(view);
    u[0] = e[0];
    u[1] = e[1];
    u[2] = view.task_state[kHeight] + kLift - 2 * kLift * std::clamp((step - 4) / 18.0, 0.0, 1.0);
    u[3] = e[2];
    u[4] = u[5] = view.task_state[kGrip];
  }

  void observe(const TaskView& view, std::span<double> o) const override {
    const Readings read(view);
    std::array<double, 2 * kPads * kPoints> flow{};
    normalised_flow(read.pads(), flow, kTooLittle);
    for (std::size_t pad = 0; pad < kPads; ++pad)
      for (std::size_t p = 0; p < kPoints; ++p)
        for (std::size_t c = 0; c < 2; ++c)
          o[(2 * pad + c) * kPoints + p] = flow[(pad * kPoints + p) * 2 + c];
  }

  /// The readings' noise is given. The threshold of the normalisation only chooses between a flow
  /// and none.
  void observe_vjp(const TaskView& view, std::span<const double> weight,
                   const ViewCotangent& out) const override {
    const Readings read(view);
    std::array<double, 2 * kPads * kPoints> flow_bar{};
    std::array<ShearCotangent, kPads> pads_bar;
    for (std::size_t pad = 0; pad < kPads; ++pad) {
      pads_bar[pad] = {out.snapshots[1].tactile.subspan(3 * kPoints * pad, 3 * kPoints),
                       out.snapshots[0].tactile.subspan(3 * kPoints * pad, 3 * kPoints)};
      for (std::size_t p = 0; p < kPoints; ++p)
        for (std::size_t c = 0; c < 2; ++c)
          flow_bar[(pad * kPoints + p) * 2 + c] = weight[(2 * pad + c) * kPoints + p];
    }
    normalised_flow_vjp(read.pads(), flow_bar, pads_bar, kTooLittle);
  }

  StepOutcome evaluate(const TaskView& view) const override {
    const std::array<double, 3> e = off(view);
    const bool inside = is_above_hole(view.now()) && highest_below(view.now()) < kInside;
    double far = 0;
    for (std::size_t k = 0; k < 3; ++k) far += e[k] / kOff[k] * e[k] / kOff[k];
    return {inside ? kSuccess : -far, inside, inside};
  }

  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    if (evaluate(view).success) return;
    std::array<double, 3> off_bar = off(view);
    for (std::size_t k = 0; k < 3; ++k) off_bar[k] *= -weight * 2 / (kOff[k] * kOff[k]);
    off_vjp(off_bar, out);
  }

  void controls_vjp(const TaskView&, int, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    off_vjp({weight[0], weight[1], weight[3]}, out);
    out.task_state[kHeight] += weight[2];
    out.task_state[kGrip] += weight[4] + weight[5];
  }

  void begin_action_vjp(const TaskView&, std::span<double> memory,
                        const ViewCotangent& out) const override {
    for (std::size_t a = 0; a < moved_.size(); ++a) {
      const std::size_t k = moved_[a];
      out.action[a] += kAct[k] * (memory[kNow + k] + (k == 2 ? memory[kTurned] : 0));
    }
    for (std::size_t k = 0; k < 3; ++k) memory[kNow + k] += std::exchange(memory[kBefore + k], 0.0);
  }

  /// Reverse of hold(): hand and box turn about the same axis.
  void restart_state_vjp(const TaskView&, std::span<const double> q, std::span<const double>,
                         const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < 2; ++k) out.task_state[kNow + k] += q[hand_v_ + k] + q[box_v_ + k];
    out.task_state[kNow + 2] += q[turn_v_] + q[box_v_ + 5];
    out.task_state[kHeight] += q[hand_v_ + 2];
  }

  void scripted(const TaskView& view, std::span<const double> o,
                std::span<double> action) const override;

 private:
  static constexpr std::array<double, 3> kHalf{0.0175, 0.025, 0.03};  // half edges of the box [m]
  static constexpr double kApart = -0.0177;  // position of the fingers: 0.2 mm from the box [m]

  /// Readings of the pads at steps 6 and 44, noise included.
  struct Readings {
    static constexpr std::size_t kNumbers = 3 * kPads * kPoints;
    std::array<double, kNumbers> read{}, first{};

    explicit Readings(const TaskView& view) {
      const auto noise = [&](std::size_t i) {
        return task_normal(view.seed, view.episode, 1 + view.actions, static_cast<std::uint32_t>(i),
                           kNoise);
      };
      for (std::size_t i = 0; i < kNumbers; ++i) {
        read[i] = view.snapshots[1].tactile[i] + noise(i);
        first[i] = view.snapshots[0].tactile[i] + noise(kNumbers + i);
      }
    }
    [[nodiscard]] std::array<ShearField<double>, kPads> pads() const {
      std::array<ShearField<double>, kPads> pads;
      for (std::size_t pad = 0; pad < kPads; ++pad)
        pads[pad] = {std::span<const double>(read).subspan(3 * kPoints * pad, 3 * kPoints),
                     std::span<const double>(first).subspan(3 * kPoints * pad, 3 * kPoints)};
      return pads;
    }
  };

  [[nodiscard]] bool is_above_hole(const Snapshot& m) const {
    return std::abs(rest_[0] + m.q[box_]) < kHole[0] &&
           std::abs(rest_[1] + m.q[box_ + 1]) < kHole[1];
  }
  /// Height of the highest corner of the box's lower face [m]. A box that tilts in its grip is not
  /// inside.
  [[nodiscard]] double highest_below(const Snapshot& m) const {
    const double* const r = &m.q[box_ + 3];
    const double zx = 2 * (r[1] * r[3] - r[0] * r[2]), zy = 2 * (r[2] * r[3] + r[0] * r[1]);
    const double zz = 1 - 2 * (r[1] * r[1] + r[2] * r[2]);
    return rest_[2] + m.q[box_ + 2] + std::abs(zx) * kHalf[0] + std::abs(zy) * kHalf[1] -
           zz * kHalf[2];
  }
  [[nodiscard]] bool slides() const { return moved_.front() == 0; }
  [[nodiscard]] bool turns() const { return moved_.back() == 2; }
  /// e in the current action: e before it plus the commanded change.
  [[nodiscard]] std::array<double, 3> off(const TaskView& view) const {
    std::array<double, 3> e{view.task_state[kBefore], view.task_state[kBefore + 1],
                            view.task_state[kBefore + 2]};
    for (std::size_t a = 0; a < moved_.size() && a < view.action.size(); ++a)
      e[moved_[a]] += kAct[moved_[a]] * view.action[a];
    return e;
  }

  void off_vjp(const std::array<double, 3>& off_bar, const ViewCotangent& out) const {
    for (std::size_t k = 0; k < 3; ++k) out.task_state[kBefore + k] += off_bar[k];
    for (std::size_t a = 0; a < moved_.size(); ++a)
      out.action[a] += kAct[moved_[a]] * off_bar[moved_[a]];
  }

  void hold(const TaskView& view, std::span<double> q, std::span<double> v) const {
    const std::span<const double> e = view.task_state.subspan(kNow, 3);
    std::fill(v.begin(), v.end(), 0.0);
    q[hand_] = e[0];
    q[hand_ + 1] = e[1];
    q[hand_ + 2] = view.task_state[kHeight];
    q[turn_] = e[2];
    q[finger_] = q[finger_ + 1] = kApart;
    q[box_] = e[0] - rest_[0];
    q[box_ + 1] = e[1] - rest_[1];
    q[box_ + 2] = 0;
    q[box_ + 3] = std::cos(e[2] / 2);
    q[box_ + 4] = q[box_ + 5] = 0;
    q[box_ + 6] = std::sin(e[2] / 2);
  }

  Friction friction_;
  std::vector<std::size_t> moved_;          // the components of e that an action changes
  std::size_t hand_, turn_, finger_, box_;  // coordinates
  std::size_t hand_v_, turn_v_, box_v_;     // dofs
  Vector3 rest_{};                          // rest position of the box's joint
};

/// Estimates the error from the rim's forces. An error in x loads one finger more than the other.
/// An error in y turns the box about the grip. The script then moves the box back by the mean
/// offset that misses the hole. A box with a yaw error stands on two opposite corners, with the
/// same forces for both signs, so the script takes one, then the other.
void Insertion::scripted(const TaskView& view, std::span<const double> o,
                         std::span<double> action) const {
  std::array<double, kPads> up{};
  double moment = 0, square = 0;
  for (std::size_t pad = 0; pad < kPads; ++pad) {
    const double sign =
        pad == 0 ? 1
                 : -1;  // rows of the left pad go up, those of the right pad down; columns to -y
    for (std::size_t p = 0; p < kPoints; ++p) {
      const double fz = sign * o[2 * pad * kPoints + p], fy = -o[(2 * pad + 1) * kPoints + p];
      const std::size_t row = p / kCols, col = p % kCols;
      const double z = sign * (static_cast<double>(row) - 6), y = 4.5 - static_cast<double>(col);
      up[pad] += fz;
      moment += y * fz - z * fy;
      square += y * y + z * z;
    }
  }
  const double total = up[0] + up[1], apart = (up[1] - up[0]) / total,
               turning = 10 * moment / square;
  std::array<double, 3> move{};
  const bool has_force = total > 0;
  if (has_force && slides() && std::abs(apart) > kApartNoise)
    move[0] = -std::copysign(kShift, apart);
  if (has_force && slides() && std::abs(turning) > kTurningNoise)
    move[1] = -std::copysign(kShift, turning);
  const bool straight = move[0] == 0 && move[1] == 0;
  if (has_force && straight && !turns()) {
    // The box is off, but no reading exceeds the noise: take the largest.
    const std::size_t k = std::abs(apart) / kApartNoise > std::abs(turning) / kTurningNoise ? 0 : 1;
    move[k] = -std::copysign(kShift, k == 0 ? apart : turning);
  }
  if (turns() && (straight || view.actions % kPatience == kPatience - 1)) {
    const double turned = view.task_state[kTurned];
    const double next = turned == 0 ? kTurn : turned > 0 ? -kTurn : slides() ? 0 : kTurn;
    move[2] = next - turned;
  }
  for (std::size_t a = 0; a < moved_.size(); ++a)
    action[a] = std::clamp(move[moved_[a]] / kAct[moved_[a]], -1.0, 1.0);
}

}  // namespace

TaskSpec declare_insertion(InsertionMotion motion, Friction friction) {
  const bool turns = motion != InsertionMotion::translation,
             slides = motion != InsertionMotion::rotation;
  TaskSpec spec;
  spec.name = !slides ? "insertion_rotation" : !turns ? "insertion_translation" : "insertion";
  spec.summary = !slides  ? "The same; only the yaw is off and is corrected."
                 : !turns ? "The same; only the place is off and is corrected."
                          : "A held box is moved and turned until it goes into a hole.";
  spec.scene = "insertion.xml";
  spec.success =
      "the box's middle is above the hole and all corners of its lower face are below 24.7 mm at "
      "the end of an attempt";
  spec.action = {"correction",
                 {(turns ? 1U : 0U) + (slides ? 2U : 0U)},
                 "1",
                 !slides  ? "of the yaw, times 10 degrees"
                 : !turns ? "of x and y, times 20 mm"
                          : "of x and y, times 20 mm, and of the yaw, times 10 degrees",
                 {},
                 -1,
                 1};
  spec.observations = {{"flow",
                        {4, 13, 10},
                        "1",
                        "normalised change of shear from step 6 to 44: left pad up and to -y, "
                        "right pad down and to -y",
                        {},
                        -1,
                        1}};
  spec.observations.back().touch = true;
  spec.steps_per_action = kSteps;
  spec.control_every = 1;
  spec.snapshots = {6, 44, kSteps};
  spec.horizon = kAttempts - 1;
  spec.warm_up = true;
  spec.restarts = true;
  spec.task_state = 9;
  spec.reads_tactile = true;
  return with_friction(std::move(spec), friction);
}

std::unique_ptr<Task> make_insertion(const Scene& scene, InsertionMotion motion,
                                     Friction friction) {
  return std::make_unique<Insertion>(scene, motion, friction);
}

}  // namespace tangere
