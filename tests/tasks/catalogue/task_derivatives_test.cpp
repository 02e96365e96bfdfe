// SPDX-License-Identifier: Apache-2.0
// Tests the reward, the observation and the other functions of every task, one at a time, against
// differences.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>

#include "engine/model/random.hpp"
#include "engine/step/displacement.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using testing::OwnView;
using testing::task_named;

/// A function of a view, and the function that adds its derivatives by all that the view shows.
struct OfView {
  std::function<double()> value;
  std::function<void(const ViewCotangent& out)> reverse;
};

/// Changes one number of a view by a small step, however it is stored.
class Differences {
 public:
  Differences(const Task& task, OwnView& own, OfView of)
      : task_(task), own_(own), of_(std::move(of)) {}

  /// Compares the derivative by every number, or by forty of many, with central differences.
  void check() {
    const std::size_t moments = own_.q.size();
    std::vector<std::vector<double>> q, v, end_effectors, tactile;
    std::vector<SnapshotCotangent> to;
    for (std::size_t m = 0; m < moments; ++m) {
      q.emplace_back(v.emplace_back(std::size_t(task_.model().nv())));
      end_effectors.emplace_back(task_.end_effectors_size());
      tactile.emplace_back(task_.tactile_size());
    }
    for (std::size_t m = 0; m < moments; ++m)
      to.push_back({q[m], v[m], end_effectors[m], tactile[m]});
    std::vector<double> action(own_.action.size()), memory(own_.memory.size());
    of_.reverse({to, action, memory});
    for (std::size_t m = 0; m < moments; ++m) {
      for (std::size_t i = 0; i < q[m].size(); ++i) compare("q", q[m][i], displaced(m, i));
      each("v", own_.v[m], v[m]);
      each("variables", own_.end_effectors[m], end_effectors[m]);
      each("tactile", own_.tactile[m], tactile[m]);
    }
    each("action", own_.action, action);
    each("memory", own_.memory, memory);
  }

 private:
  using Move = std::function<void(double)>;
  void each(const char* what, std::vector<double>& x, const std::vector<double>& slope) {
    const std::size_t count = std::min<std::size_t>(x.size(), 40);
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = k * x.size() / count;
      const double at = x[i];
      compare(what, slope[i], [&x, i, at](double d) { x[i] = at + d; });
      x[i] = at;
    }
  }
  void compare(const char* what, double slope, const Move& move) {
    constexpr double kStep = 1e-6;
    move(kStep);
    const double above = of_.value();
    move(-kStep);
    const double below = of_.value();
    move(0);
    const double expected = (above - below) / (2 * kStep);
    EXPECT_NEAR(slope, expected, 1e-5 * (1 + std::abs(expected))) << what;
  }
  Move displaced(std::size_t m, std::size_t dof) {
    std::vector<double>& q = own_.q[m];
    return [this, &q, at = q, dof](double x) {
      q = at;
      displace(task_.model(), q, static_cast<int>(dof), x);
    };
  }

  const Task& task_;
  OwnView& own_;
  OfView of_;
};

class EveryTask : public ::testing::TestWithParam<std::string> {};

/// Fills a view with random numbers, quaternions of unit length among them.
void draw_all(const Task& task, OwnView& own, std::uint64_t seed) {
  std::uint32_t index = 0;
  const auto number = [&] { return uniform({seed, 0, 0, Purpose::control, index++}, -1, 1); };
  for (auto* part : {&own.memory, &own.action})
    for (double& x : *part) x = number();
  for (auto* parts : {&own.q, &own.v, &own.end_effectors, &own.tactile})
    for (auto& part : *parts)
      for (double& x : part) x = 0.1 * number();
  std::size_t c = 0;
  for (const LinkDescription& link : task.model().scene().links) {
    const std::size_t count = std::size_t(position_count(link.joint.type));
    const bool turns =
        link.joint.type == JointType::free || link.joint.type == JointType::spherical;
    for (auto& q : own.q) {
      if (!turns) continue;
      double square = 0;
      q[c + count - 4] += 1;
      for (std::size_t k = c + count - 4; k < c + count; ++k) square += q[k] * q[k];
      for (std::size_t k = c + count - 4; k < c + count; ++k) q[k] /= std::sqrt(square);
    }
    c += count;
  }
}

TEST_P(EveryTask, TheRewardsDerivativesAreThoseOfDifferences) {
  const auto task = task_named(GetParam());
  constexpr double kWeight = 1.7;
  for (std::uint64_t trial = 0; trial < 5; ++trial) {
    OwnView own(*task);
    draw_all(*task, own, 5 + 100 * trial);
    Differences(*task, own,
                {[&] { return kWeight * task->evaluate(own.view()).reward; },
                 [&](const ViewCotangent& out) { task->reward_vjp(own.view(), kWeight, out); }})
        .check();
  }
}

TEST_P(EveryTask, TheObservationsDerivativesAreThoseOfDifferences) {
  const auto task = task_named(GetParam());
  std::vector<double> weight(task->spec().observation_size()), o(weight.size());
  for (std::size_t k = 0; k < weight.size(); ++k)
    weight[k] = uniform({13, 0, 0, Purpose::control, std::uint32_t(k)}, -1, 1);
  for (std::uint64_t trial = 0; trial < 3; ++trial) {
    OwnView own(*task);
    draw_all(*task, own, 6 + 100 * trial);
    Differences(*task, own,
                {[&] {
                   task->observe(own.view(), o);
                   return std::inner_product(o.begin(), o.end(), weight.begin(), 0.0);
                 },
                 [&](const ViewCotangent& out) { task->observe_vjp(own.view(), weight, out); }})
        .check();
  }
}

/// Makes a view with random numbers; positions and memory are small.
void draw(OwnView& own, std::uint64_t seed) {
  std::uint32_t index = 0;
  const auto number = [&] { return uniform({seed, 0, 0, Purpose::control, index++}, -1, 1); };
  for (double& x : own.memory) x = 0.05 * number();
  for (double& x : own.action) x = 0.3 * number();
  for (double& x : own.q.back()) x = 0.1 * number();
}

/// Compares what a function of a view hands back with differences of weight · function by memory,
/// action and q.
class ViewDerivatives {
 public:
  ViewDerivatives(const Task& task, OwnView& own)
      : action(own.action.size()),
        memory(own.memory.size()),
        own_(own),
        q_(std::size_t(task.model().nv())),
        v_(q_.size()) {}

  std::vector<double> action, memory;

  [[nodiscard]] ViewCotangent out() {
    to_ = {{q_, v_, {}, {}}};
    return {to_, action, memory};
  }
  /// `by_q`: of coordinates that are dofs as well.
  void check(const std::function<double()>& value, std::size_t by_q, const std::string& what) {
    each(own_.action, action, value, what + " by the action");
    each(own_.memory, memory, value, what + " by the memory");
    each(own_.q.back(), std::vector<double>(q_.begin(), q_.begin() + std::ptrdiff_t(by_q)), value,
         what + " by q");
  }

 private:
  static void each(std::vector<double>& x, const std::vector<double>& slope,
                   const std::function<double()>& value, const std::string& what) {
    for (std::size_t k = 0; k < slope.size(); ++k) {
      const double at = x[k];
      x[k] = at + 1e-6;
      const double above = value();
      x[k] = at - 1e-6;
      const double below = value();
      x[k] = at;
      EXPECT_NEAR(slope[k], (above - below) / 2e-6, 1e-7) << what << " " << k;
    }
  }
  OwnView& own_;
  std::vector<double> q_, v_;
  std::vector<SnapshotCotangent> to_;
};

/// Number of coordinates before the first quaternion. They have the same indices as their dofs.
std::size_t plain_coordinates(const Task& task) {
  std::size_t count = 0;
  for (const LinkDescription& link : task.model().scene().links) {
    if (link.joint.type == JointType::free || link.joint.type == JointType::spherical) break;
    count += std::size_t(position_count(link.joint.type));
  }
  return count;
}

TEST_P(EveryTask, TheControlsDerivativesAreThoseOfDifferences) {
  const auto task = task_named(GetParam());
  OwnView own(*task);
  draw(own, 6);
  std::vector<double> weight(std::size_t(task->model().nu()));
  for (std::size_t k = 0; k < weight.size(); ++k)
    weight[k] = uniform({7, 0, 0, Purpose::control, std::uint32_t(k)}, -1, 1);
  for (const int step : {0, task->spec().steps_per_action / 2}) {
    ViewDerivatives slopes(*task, own);
    task->controls_vjp(own.view(), step, weight, slopes.out());
    slopes.check(
        [&] {
          std::vector<double> u(weight.size());
          task->controls(own.view(), step, u);
          return std::inner_product(u.begin(), u.end(), weight.begin(), 0.0);
        },
        plain_coordinates(*task), "controls of step " + std::to_string(step));
  }
}

TEST_P(EveryTask, WhatAnActionKeepsHasTheDerivativesOfDifferences) {
  const auto task = task_named(GetParam());
  OwnView own(*task);
  draw(own, 8);
  std::vector<double> weight(own.memory.size());
  for (std::size_t k = 0; k < weight.size(); ++k)
    weight[k] = uniform({9, 0, 0, Purpose::control, std::uint32_t(k)}, -1, 1);
  for (own.actions = 0; own.actions < 2; ++own.actions) {
    ViewDerivatives slopes(*task, own);
    std::vector<double> memory = weight;
    const ViewCotangent out = slopes.out();
    task->begin_action_vjp(own.view(), memory, {out.snapshots, out.action});
    slopes.memory = memory;
    slopes.check(
        [&] {
          const std::vector<double> found = own.memory;
          task->begin_action(own.view(), own.memory);  // in place, as a VectorTask does
          const double value =
              std::inner_product(own.memory.begin(), own.memory.end(), weight.begin(), 0.0);
          own.memory = found;
          return value;
        },
        plain_coordinates(*task), "memory");
  }
}

TEST_P(EveryTask, RestartsHaveTheDerivativesOfDifferences) {
  const auto task = task_named(GetParam());
  OwnView own(*task);
  draw(own, 10);
  const std::size_t nq = std::size_t(task->model().nq()), nv = std::size_t(task->model().nv());
  std::vector<double> by_q(nq), by_v(nv), along(nv), start(nq), speed(nv);
  for (std::size_t k = 0; k < nq; ++k)
    by_q[k] = uniform({11, 0, 0, Purpose::control, std::uint32_t(k)}, -1, 1);
  for (std::size_t k = 0; k < nv; ++k)
    by_v[k] = uniform({12, 0, 0, Purpose::control, std::uint32_t(k)}, -1, 1);
  ViewDerivatives slopes(*task, own);
  if (!task->spec().restarts) {
    EXPECT_THROW(task->restart_state_vjp(own.view(), along, by_v, slopes.out()), InputError);
    return;
  }
  task->restart_state(own.view(), start, speed);
  add_along_dofs(task->model(), start, by_q, along);
  task->restart_state_vjp(own.view(), along, by_v, slopes.out());
  slopes.check(
      [&] {
        std::vector<double> q(nq), v(nv);
        task->restart_state(own.view(), q, v);
        return std::inner_product(q.begin(), q.end(), by_q.begin(), 0.0) +
               std::inner_product(v.begin(), v.end(), by_v.begin(), 0.0);
      },
      plain_coordinates(*task), "place");
}

INSTANTIATE_TEST_SUITE_P(Tasks, EveryTask, ::testing::ValuesIn(task_names()),
                         [](const auto& given) { return given.param; });

}  // namespace
}  // namespace tangere
