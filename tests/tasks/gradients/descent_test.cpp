// SPDX-License-Identifier: Apache-2.0
// Tests that gradients descend: open-loop pushes found by Adam bring a box nearer to its goals, and
// a policy learns to push.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "io/scene/scene_reader.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/task_tape.hpp"

namespace tangere {
namespace {

constexpr int kEnvironments = 16, kHeld = 5, kActions = 60;
constexpr int kHandControls = 3;  // hand x, y, turn; the other three disturb the box and stay 0

/// Requested displacement of the box [m], from where it starts.
using Goal = std::array<double, 2>;

/// ½ |box − goal|² at the end [m²], plus a small cost of controls.
class ReachGoal : public RolloutLoss {
 public:
  ReachGoal(std::size_t box, std::span<const Goal> goals) : box_(box), goals_(goals) {}

  [[nodiscard]] double distance(std::span<const double> q, int e) const {
    const Goal& g = goals_[std::size_t(e)];
    return std::hypot(q[box_] - g[0], q[box_ + 1] - g[1]);
  }
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    double sum = 0;
    for (std::size_t i = 0; i < at.u.size(); ++i) {
      sum += 0.5 * kControlCost * at.u[i] * at.u[i];
      out.u[i] += kControlCost * at.u[i];
    }
    if (at.step != at.steps) return sum;
    const double d = distance(at.q, at.environment);
    // No joint before the box has a quaternion, so dofs and coordinates have the same places.
    for (std::size_t i = 0; i < 2; ++i)
      out.q[box_ + i] += at.q[box_ + i] - goals_[std::size_t(at.environment)][i];
    return sum + 0.5 * d * d;
  }

 private:
  static constexpr double kControlCost = 1e-8;  // [m²] for a step
  std::size_t box_;
  std::span<const Goal> goals_;
};

/// Kingma and Ba's, with their constants.
class Adam {
 public:
  Adam(std::size_t n, double rate) : rate_(rate), mean_(n), square_(n) {}
  void step(std::span<double> x, std::span<const double> gradient) {
    ++count_;
    const double a = 1 - std::pow(kMean, count_), b = 1 - std::pow(kSquare, count_);
    for (std::size_t i = 0; i < x.size(); ++i) {
      mean_[i] = kMean * mean_[i] + (1 - kMean) * gradient[i];
      square_[i] = kSquare * square_[i] + (1 - kSquare) * gradient[i] * gradient[i];
      x[i] -= rate_ * (mean_[i] / a) / (std::sqrt(square_[i] / b) + 1e-12);
    }
  }

 private:
  static constexpr double kMean = 0.9, kSquare = 0.999;
  double rate_;
  int count_ = 0;
  std::vector<double> mean_, square_;
};

struct Pushes {
  Model model;
  std::vector<double> actions;  // (E, kActions, kHandControls)

  void controls(std::int64_t step, int e, std::span<double> u) const {
    std::fill(u.begin(), u.end(), 0.0);
    const std::size_t at = (std::size_t(e) * kActions + std::size_t(step / kHeld)) * kHandControls;
    for (std::size_t i = 0; i < kHandControls; ++i) u[i] = actions[at + i];
  }
};

/// Sums over the steps that hold an action; zero for controls that are not optimised.
std::vector<double> actions_bar(const Pushes& p, std::span<const double> by_steps) {
  const std::size_t nu = std::size_t(p.model.nu()), steps = std::size_t(kActions * kHeld);
  std::vector<double> out(p.actions.size());
  for (std::size_t e = 0; e < kEnvironments; ++e)
    for (std::size_t t = 0; t < steps; ++t)
      for (std::size_t i = 0; i < kHandControls; ++i)
        out[(e * kActions + t / kHeld) * kHandControls + i] += by_steps[(e * steps + t) * nu + i];
  return out;
}

double mean_distance(const Pushes& p, const ReachGoal& loss) {
  Batch batch(p.model, kEnvironments, 1);
  Stepper stepper(p.model);
  const std::size_t nu = std::size_t(p.model.nu());
  std::vector<double> u(nu * kEnvironments), q(std::size_t(p.model.nq()));
  for (int t = 0; t < kActions * kHeld; ++t) {
    for (int e = 0; e < kEnvironments; ++e)
      p.controls(t, e, std::span(u).subspan(std::size_t(e) * nu, nu));
    stepper.step(batch, u);
  }
  double sum = 0;
  for (int e = 0; e < kEnvironments; ++e) {
    batch.get_q(e, q);
    sum += loss.distance(q, e) / kEnvironments;
  }
  return sum;
}

TEST(Descent, FiftyAdamStepsHalveTheDistanceOfAPushedBox) {
  Pushes p{Model(read_scene(TANGERE_SOURCE_DIR "/scenes/box_pushing.xml").scene), {}};
  p.actions.resize(kEnvironments * kActions * kHandControls);
  // A small push that brings the pad to the box, because without contact no control has a gradient.
  for (std::size_t k = 0; k < p.actions.size(); k += kHandControls) p.actions[k] = 0.05;
  const auto names = p.model.q_names();
  const auto box =
      std::size_t(std::find(names.begin(), names.end(), "box_slide.x") - names.begin());
  ASSERT_LT(box, names.size());
  std::array<Goal, kEnvironments> goals;  // 60 to 120 mm ahead, up to 20 mm aside
  for (std::size_t e = 0; e < kEnvironments; ++e) {
    const std::size_t row = e / 4, col = e % 4;
    goals[e] = {0.06 + 0.02 * double(row), -0.02 + 0.04 / 3 * double(col)};
  }
  const ReachGoal loss(box, goals);
  const RolloutLoss* const losses[] = {&loss};
  TapeOptions options;
  options.length = kActions * kHeld;

  const double before = mean_distance(p, loss);
  Adam adam(p.actions.size(), 0.02);
  for (int k = 0; k < 50; ++k) {
    const GradientSummary g = rollout_gradients(
        Batch(p.model, kEnvironments, 1),
        [&](std::int64_t t, int e, std::span<double> u) { p.controls(t, e, u); }, options, losses);
    ASSERT_TRUE(g.failures.empty());
    adam.step(p.actions, actions_bar(p, g.losses[0].u));
  }
  const double after = mean_distance(p, loss);
  RecordProperty("mean_distance_before", std::to_string(before));
  RecordProperty("mean_distance_after", std::to_string(after));
  EXPECT_LT(after, 0.5 * before) << "mean distances [m]";
}

/// Does the same for a task: Adam raises its return by the actions of 16 episodes with random
/// pushes.
TEST(Descent, AdamOnActionsRaisesTheReturnOfBoxPushing) {
  const auto task = make_task("box_pushing_reduced",
                              read_scene(TANGERE_SOURCE_DIR "/scenes/box_pushing.xml").scene);
  constexpr std::size_t kWidth = 3;
  std::vector<double> actions(kEnvironments * kActions * kWidth);
  for (std::size_t k = 0; k < actions.size(); k += kWidth) actions[k] = 0.05;
  TapeOptions options;
  options.length = kActions;
  const TaskActions given = [&](const TaskView& view, std::span<const double>,
                                std::span<double> action) {
    std::copy_n(actions.begin() + (view.episode * kActions + view.actions) * std::int64_t(kWidth),
                kWidth, action.begin());
  };
  Adam adam(actions.size(), 0.02);
  double before = 0, after = 0;
  for (int k = 0; k <= 50; ++k) {
    const TaskGradients g = task_gradients(*task, given, 1, {0, kEnvironments}, options);
    ASSERT_TRUE(g.failures.empty());
    after = std::accumulate(g.value.begin(), g.value.end(), 0.0) / kEnvironments;
    if (k == 0) before = after;
    std::vector<double> down(g.u.size());
    std::transform(g.u.begin(), g.u.end(), down.begin(), [](double x) { return -x; });
    adam.step(actions, down);
  }
  RecordProperty("mean_return_before", std::to_string(before));
  RecordProperty("mean_return_after", std::to_string(after));
  EXPECT_LT(before, 0);
  EXPECT_GT(after, 0.5 * before);
}

/// Trains a policy in closed loop: Adam on a linear policy that sees goal and box, by derivatives
/// through observations.
TEST(Descent, BackPropagationThroughTimeTrainsAPolicyThatPushes) {
  const auto task = make_task("box_pushing_privileged",
                              read_scene(TANGERE_SOURCE_DIR "/scenes/box_pushing.xml").scene);
  constexpr std::size_t kWidth = 3;
  constexpr int kUpdates = 25;
  constexpr double kMost = 0.45, kScale = 10;  // of an action; of what the policy sees [1/m, 1/rad]
  const std::size_t seen = task->spec().observation_size(), inputs = seen + 1;
  TapeOptions options;
  options.length = kActions;
  options.threads = 2;
  TaskTape tape(*task, kEnvironments, options);
  std::vector<double> weights(kWidth * inputs);
  weights[seen] = 0.2;  // the first action pushes ahead
  Adam adam(weights.size(), 0.03);
  double before = 0, after = 0;
  for (int k = 0; k <= kUpdates; ++k) {
    tape.reset(std::uint64_t(k % kUpdates), 0);  // the first episodes are played again at the end
    std::vector<std::vector<double>> observed, actions;
    double sum = 0;
    for (int t = 0; t < kActions; ++t) {
      std::vector<double>& o = observed.emplace_back(kEnvironments * inputs, 1.0);
      std::vector<double>& a = actions.emplace_back(kEnvironments * kWidth);
      for (std::size_t e = 0; e < kEnvironments; ++e) {
        for (std::size_t j = 0; j < seen; ++j)
          o[e * inputs + j] = kScale * tape.observations()[e * seen + j];
        for (std::size_t i = 0; i < kWidth; ++i)
          a[e * kWidth + i] = std::tanh(std::inner_product(
              o.begin() + std::ptrdiff_t(e * inputs), o.begin() + std::ptrdiff_t((e + 1) * inputs),
              weights.begin() + std::ptrdiff_t(i * inputs), 0.0));
      }
      std::vector<double> taken = a;
      for (double& x : taken) x *= kMost;
      tape.step(taken);
      for (const double r : tape.rewards()) sum += r / kEnvironments;
    }
    after = sum;
    if (k == 0) before = sum;
    std::vector<double> down(weights.size()), observation_bar, action_bar(kEnvironments * kWidth);
    const std::vector<double> reward_bar(kEnvironments, -1.0 / kEnvironments);
    for (std::size_t t = kActions; t-- > 0;) {
      tape.reverse({observation_bar, reward_bar}, action_bar);
      observation_bar.assign(kEnvironments * seen, 0.0);
      for (std::size_t e = 0; e < kEnvironments; ++e)
        for (std::size_t i = 0; i < kWidth; ++i) {
          const double squashed = actions[t][e * kWidth + i];
          const double inner = action_bar[e * kWidth + i] * kMost * (1 - squashed * squashed);
          for (std::size_t j = 0; j < inputs; ++j)
            down[i * inputs + j] += inner * observed[t][e * inputs + j];
          for (std::size_t j = 0; j < seen; ++j)
            observation_bar[e * seen + j] += inner * kScale * weights[i * inputs + j];
        }
    }
    adam.step(weights, down);
  }
  RecordProperty("mean_return_before", std::to_string(before));
  RecordProperty("mean_return_after", std::to_string(after));
  EXPECT_LT(before, 0);
  EXPECT_GT(after, 0.7 * before);
}

}  // namespace
}  // namespace tangere
