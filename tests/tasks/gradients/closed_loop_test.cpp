// SPDX-License-Identifier: Apache-2.0
// Tests derivatives of a whole closed loop for every task, in three ways: through a TaskTape, by
// differences of whole episodes, and by tangents, with the observation's own from differences.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/derivative/number_gradients.hpp"
#include "engine/model/random.hpp"
#include "engine/step/displacement.hpp"
#include "tasks/gradients/task_tangent.hpp"
#include "tasks/gradients/task_tape.hpp"
#include "tests/tasks/gradients/observed_change.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using Numbers = std::vector<double>;

double times(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}
double length(std::span<const double> a) { return std::sqrt(times(a, a)); }

Numbers drawn(std::size_t n, std::uint32_t seed, double size = 1) {
  Numbers x(n);
  for (std::size_t k = 0; k < n; ++k)
    x[k] = uniform({seed, 0, 0, Purpose::control, std::uint32_t(k)}, -size, size);
  return x;
}

/// A random direction of length 1 plus the gradient's, so that the gradient has a share in it.
Numbers direction(const Numbers& gradient, std::uint32_t seed) {
  Numbers d = drawn(gradient.size(), seed);
  const double own = length(d), other = length(gradient);
  for (std::size_t k = 0; k < d.size(); ++k)
    d[k] = d[k] / own + (other > 0 ? gradient[k] / other : 0);
  return d;
}

using Moves = std::vector<std::pair<std::size_t, double>>;  // dofs and how far [m] or [rad]

struct LoopCase {
  const char* task;
  std::int64_t actions;
  std::int64_t episode = 0;
  Moves moved = {};  ///< of the first state from what the task draws
};
/// The bar, from its dof 6 on. Undisturbed, it lies on edges of the tables, and the pads are mirror
/// images whose largest shears are two at once.
const Moves kBarAside{{6, 2e-4}, {7, 3e-4}, {11, 4e-3}};
void PrintTo(const LoopCase& c, std::ostream* out) { *out << c.task << " " << c.actions; }

constexpr double kSway = 0.05;  // largest share of the policy in an action

/// What a closed loop depends on, and derivatives by it.
struct LoopInputs {
  Numbers w, b;  // (action, observation), (action)
  Numbers q, v;  // (nv) displacement of the first state
};

/// One episode of a task under a = base_t + kSway tanh(W o/scale + b). The base is what the task's
/// own script did, taken as given. L = Σ r_t + c·o_N/scale + c_q·q_N + c_v·v_N, with products along
/// the coordinates that are dofs.
class ClosedLoop {
 public:
  ClosedLoop(const Task& task, const LoopCase& c)
      : task_(task),
        tape_(task, 1, options_of(c)),
        episode_(c.episode),
        moved_(c.moved),
        n_(std::size_t(c.actions)),
        width_(task.spec().action.size()),
        seen_(task.spec().observation_size()),
        nv_(std::size_t(task.model().nv())) {
    record_base();
    for (const LinkDescription& link : task.model().scene().links) {
      if (link.joint.type == JointType::free || link.joint.type == JointType::spherical) break;
      plain_ += std::size_t(position_count(link.joint.type));
    }
    end_o_ = drawn(seen_, 21);
    for (std::size_t k = 0; k < seen_; ++k) end_o_[k] /= scale_[k];
    end_q_ = drawn(plain_, 22, 10);
    end_q_.resize(nv_);
    end_v_ = drawn(nv_, 23);
  }

  [[nodiscard]] LoopInputs inputs() const {
    LoopInputs at{drawn(width_ * seen_, 24, 3 / std::sqrt(double(seen_))), drawn(width_, 25),
                  Numbers(nv_), Numbers(nv_)};
    for (const auto& [dof, by] : moved_) at.q[dof] = by;
    return at;
  }

  /// Returns L. Keeps what the derivatives need.
  double play(const LoopInputs& at) {
    tape_.reset(kSeed, episode_);
    Numbers q(tape_.q().begin(), tape_.q().end()), v(tape_.v().begin(), tape_.v().end());
    for (std::size_t i = 0; i < nv_; ++i) {
      displace(task_.model(), q, int(i), at.q[i]);
      v[i] += at.v[i];
    }
    tape_.displace(q, v);
    first_q_ = q;
    first_v_ = v;
    observed_.clear();
    squashed_.clear();
    actions_.clear();
    double loss = 0;
    for (std::size_t t = 0; t < n_; ++t) {
      observed_.emplace_back(tape_.observations().begin(), tape_.observations().end());
      for (std::size_t k = 0; k < seen_; ++k) observed_.back()[k] /= scale_[k];
      Numbers action(width_), squashed(width_);
      for (std::size_t k = 0; k < width_; ++k) {
        squashed[k] = std::tanh(times(row(at.w, k), observed_.back()) + at.b[k]);
        action[k] = base_[t * width_ + k] + kSway * squashed[k];
      }
      squashed_.push_back(squashed);
      actions_.insert(actions_.end(), action.begin(), action.end());
      tape_.step(action);
      loss += tape_.rewards()[0];
    }
    return loss + times(end_o_, tape_.observations()) + times(end_v_, tape_.v()) +
           times(std::span(end_q_).first(plain_), tape_.q().first(plain_));
  }

  /// Goes back through the episode played last.
  LoopInputs gradient(const LoopInputs& at) {
    LoopInputs g{Numbers(at.w.size()), Numbers(at.b.size()), Numbers(nv_), Numbers(nv_)};
    Numbers by_o = end_o_, action_bar(width_);
    const Numbers one{1};
    ActionCotangents by{by_o, one, end_q_, end_v_};
    for (std::size_t t = n_; t-- > 0;) {
      tape_.reverse(by, action_bar);
      by.q = by.v = {};
      std::fill(by_o.begin(), by_o.end(), 0.0);
      for (std::size_t k = 0; k < width_; ++k) {
        const double inner = action_bar[k] * kSway * (1 - squashed_[t][k] * squashed_[t][k]);
        g.b[k] += inner;
        for (std::size_t j = 0; j < seen_; ++j) {
          g.w[k * seen_ + j] += inner * observed_[t][j];
          by_o[j] += inner * at.w[k * seen_ + j] / scale_[j];
        }
      }
    }
    tape_.reverse_start({by_o}, {g.q, g.v});
    return g;
  }

  /// How L changes along `d`, by tangents.
  double along(const LoopInputs& at, const LoopInputs& d) {
    TaskRollout rollout(task_, stepper(), Precision::f64);
    rollout.start(kSeed, {&episode_, 1});
    rollout.displace(0, first_q_, first_v_);
    TaskTangent tangent(rollout, actions_, stepper());
    tangent.start(d.q, d.v);
    Numbers o_dot(seen_);
    if (!task_.spec().warm_up) {
      const ViewTangent first = tangent.seen_at_start({});
      o_dot = observed_change(tangent.start_view(), first);
    }
    double sum = 0;
    for (std::size_t t = 0; t < n_; ++t) {
      Numbers change(width_);
      for (std::size_t k = 0; k < width_; ++k) {
        double inner = d.b[k] + times(row(d.w, k), observed_[t]);
        for (std::size_t j = 0; j < seen_; ++j) inner += at.w[k * seen_ + j] * o_dot[j] / scale_[j];
        change[k] = kSway * (1 - squashed_[t][k] * squashed_[t][k]) * inner;
      }
      sum += tangent.take(change, {});
      o_dot = observed_change(tangent.view(), tangent.seen());
    }
    const ViewTangent& last = tangent.seen();
    return sum + times(end_o_, o_dot) + times(end_q_, last.q.back()) + times(end_v_, last.v.back());
  }

  [[nodiscard]] const TaskTape& tape() const { return tape_; }
  /// Largest tactile force seen [N]; 0 if the task shows none.
  [[nodiscard]] double strongest() const { return strongest_; }

 private:
  static constexpr std::uint64_t kSeed = 4;
  static StepperOptions stepper() { return {{}, {}, 1e-12}; }
  static TapeOptions options_of(const LoopCase& c) {
    TapeOptions o;
    o.length = c.actions;
    o.stepper = stepper();
    return o;
  }
  [[nodiscard]] std::span<const double> row(const Numbers& w, std::size_t k) const {
    return std::span(w).subspan(k * seen_, seen_);
  }

  void record_base() {
    const TensorSpec& spec = task_.spec().action;
    const double most = std::min(0.4, spec.high - 2 * kSway);
    scale_.assign(seen_, 0);
    tape_.reset(kSeed, episode_);
    Numbers action(width_);
    for (std::size_t t = 0; t <= n_; ++t) {
      std::size_t place = 0;
      for (const TensorSpec& o : task_.spec().observations) {
        double largest = 0;
        for (std::size_t k = 0; k < o.size(); ++k)
          largest = std::max(largest, std::abs(tape_.observations()[place + k]));
        if (o.name == "tactile") strongest_ = std::max(strongest_, largest);
        for (std::size_t k = 0; k < o.size(); ++k, ++place)
          scale_[place] = std::max({scale_[place], largest, 1e-9});
      }
      if (t == n_) break;
      task_.scripted(tape_.view(0), tape_.observations(), action);
      for (double& a : action) a = std::clamp(a, -most, most);
      base_.insert(base_.end(), action.begin(), action.end());
      tape_.step(action);
    }
  }

  [[nodiscard]] Numbers observed_change(const TaskView& at, const ViewTangent& change) const {
    return testing::observed_change(task_, at, change);
  }

  const Task& task_;
  TaskTape tape_;
  std::int64_t episode_;
  Moves moved_;
  std::size_t n_, width_, seen_, nv_, plain_ = 0;
  Numbers base_, scale_, end_o_, end_q_, end_v_;
  double strongest_ = 0;
  std::vector<Numbers> observed_, squashed_;  // per action; observations over their scale
  Numbers actions_, first_q_, first_v_;
};

class EveryLoop : public ::testing::TestWithParam<LoopCase> {};

TEST_P(EveryLoop, GradientsAgreeByThreeRoutes) {
  const auto task = testing::task_named(GetParam().task);
  ClosedLoop loop(*task, GetParam());
  const LoopInputs at = loop.inputs();
  const double value = loop.play(at);
  EXPECT_TRUE(std::isfinite(value));
  ASSERT_EQ(loop.tape().alive()[0], 1)
      << "the episode ended before action " << GetParam().actions - 1;
  if (std::any_of(task->spec().observations.begin(), task->spec().observations.end(),
                  [](const TensorSpec& o) { return o.name == "tactile"; })) {
    EXPECT_GT(loop.strongest(), 0) << "nothing touches";
  }
  const LoopInputs g = loop.gradient(at);
  const LoopInputs none{Numbers(at.w.size()), Numbers(at.b.size()), Numbers(at.q.size()),
                        Numbers(at.v.size())};
  using Part = Numbers LoopInputs::*;
  const std::pair<const char*, Part> parts[] = {
      {"W", &LoopInputs::w}, {"b", &LoopInputs::b}, {"q", &LoopInputs::q}, {"v", &LoopInputs::v}};
  for (const auto& [name, part] : parts) {
    LoopInputs d = none;
    d.*part = direction(g.*part, 31);
    const double slope = times(g.*part, d.*part), size = length(g.*part) * length(d.*part);
    double best = HUGE_VAL, best_step = 0;
    // Until the error is a twentieth of what is allowed.
    for (const double h : {1e-5, 1e-6, 1e-7, 1e-8, 1e-4}) {
      if (best <= 1e-6 * size) break;
      const auto moved = [&, of = part](double by) {
        LoopInputs x = at;
        for (std::size_t k = 0; k < (x.*of).size(); ++k) (x.*of)[k] += by * (d.*of)[k];
        return loop.play(x);
      };
      const double error = std::abs((moved(h) - moved(-h)) / (2 * h) - slope);
      if (error < best) best = error, best_step = h;
    }
    loop.play(at);
    const double tangent = std::abs(loop.along(at, d) - slope);
    if (size == 0) {
      EXPECT_TRUE(task->spec().restarts) << name;
      EXPECT_EQ(best, 0) << name;
      EXPECT_EQ(tangent, 0) << name;
      continue;
    }
    RecordProperty(std::string("errors_by_") + name,
                   fmt::format("differences {:.1e}, tangent {:.1e}", best / size, tangent / size));
    EXPECT_LE(best, 2e-5 * size) << name << " at step " << best_step;
    EXPECT_LE(tangent, 1e-8 * size) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Tasks, EveryLoop,
    ::testing::Values(LoopCase{"dummy", 20, 0}, LoopCase{"ball_rolling_small", 25, 0},
                      LoopCase{"box_pushing", 30, 0}, LoopCase{"box_pushing_privileged", 30, 0},
                      LoopCase{"box_pushing_reduced", 30, 0}, LoopCase{"cap_opening", 15, 0},
                      LoopCase{"cap_opening_blind", 15, 0},
                      LoopCase{"stable_grasp", 2, 0, kBarAside}, LoopCase{"insertion", 3, 0},
                      LoopCase{"insertion_translation", 2, 3},
                      LoopCase{"insertion_rotation", 2, 1}),
    [](const auto& given) { return std::string(given.param.task); });

}  // namespace
}  // namespace tangere
