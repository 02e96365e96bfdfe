// SPDX-License-Identifier: Apache-2.0
// Tests gradients of returns: correct for every task by three routes, the same bits however they
// are computed, and for the same episodes that a VectorTask plays.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/step/displacement.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/gradients/gradient_check.hpp"
#include "tasks/gradients/row_jacobians.hpp"
#include "tasks/run/policy.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using testing::task_named;

TaskActions actions_of(const Policy& policy) {
  return [&policy](const TaskView& view, std::span<const double> o, std::span<double> a) {
    policy.act(view, o, a);
  };
}

struct Checked {
  const char* task;
  PolicyKind policy;
  std::int64_t actions;
  std::int64_t episode = 0;
  int entries = 4;
};
void PrintTo(const Checked& c, std::ostream* out) {
  *out << c.task << " " << to_string(c.policy) << " " << c.actions;
}

class TaskReturn : public ::testing::TestWithParam<Checked> {};

void expect_agreement(const GradientCheck& check, double tolerance) {
  for (const CheckedInput& c : check.inputs) {
    EXPECT_LE(c.tangent_error, 1e-10) << c.name;
    EXPECT_LE(c.difference_error, tolerance) << c.name << " at " << c.worst;
  }
  EXPECT_GT(check.inputs[0].norm, 0);
  EXPECT_GT(check.inputs[0].compared, 0U);
  EXPECT_GT(check.entries(), check.kinks());
}

TEST_P(TaskReturn, GradientsAgreeByThreeRoutes) {
  const auto [name, kind, actions, episode, entries] = GetParam();
  const auto task = task_named(name);
  const Policy policy(*task, kind);
  CheckOptions options;
  options.length = actions;
  options.episode = episode;
  options.entries = entries;
  options.seed = 4;
  options.stepper.tolerance = 1e-12;
  const std::string own = name;
  const GradientCheck check = check_task_gradient(
      *task, [&](const Scene& scene) { return make_task(own, scene); }, actions_of(policy),
      options);
  expect_agreement(check, 5e-6);
}

INSTANTIATE_TEST_SUITE_P(
    Tasks, TaskReturn,
    ::testing::Values(Checked{"dummy", PolicyKind::scripted, 40},
                      Checked{"ball_rolling_small", PolicyKind::scripted, 30},
                      Checked{"box_pushing", PolicyKind::scripted, 40},
                      Checked{"box_pushing_privileged", PolicyKind::random, 20},
                      Checked{"box_pushing_reduced", PolicyKind::scripted, 20},
                      Checked{"cap_opening", PolicyKind::scripted, 20},
                      Checked{"cap_opening_blind", PolicyKind::random, 20},
                      Checked{"stable_grasp", PolicyKind::random, 2, 0, 3},
                      Checked{"insertion", PolicyKind::random, 3},
                      Checked{"insertion_translation", PolicyKind::random, 2},
                      Checked{"insertion_rotation", PolicyKind::random, 2, 1},
                      Checked{"box_pushing_elastic", PolicyKind::scripted, 20},
                      Checked{"cap_opening_elastic", PolicyKind::scripted, 10},
                      Checked{"stable_grasp_elastic", PolicyKind::random, 2, 0, 3},
                      Checked{"insertion_elastic", PolicyKind::random, 2}),
    [](const auto& given) { return std::string(given.param.task); });

/// A task that looks at everything possible, at two moments, and restarts from the place that it
/// remembers.
class Everything : public Task {
 public:
  explicit Everything(const Scene& scene)
      : Task(scene, declare()),
        pad_(coordinate("pad_joint")),
        pad_v_(dof("pad_joint")),
        ball_(coordinate("ball_joint")) {}

  static TaskSpec declare() {
    TaskSpec spec = task_spec("ball_rolling_small");
    spec.name = "everything";
    spec.control_every = 2;
    spec.snapshots = {3, 5};
    spec.horizon = 12;
    spec.restarts = true;
    spec.task_state = 4;  // where the pad is to restart, how often it pressed
    return spec;
  }
  void start(const TaskStart& s) const override {
    s.q[pad_ + 2] = -0.0149;  // it touches at once
  }
  void begin_action(const TaskView& view, std::span<double> m) const override {
    for (std::size_t k = 0; k < 3; ++k) m[k] = 0.5 * m[k] + 0.9 * view.now().q[pad_ + k];
    m[3] = 0.3 * m[3] + 0.1 * view.action[0];
  }
  void begin_action_vjp(const TaskView&, std::span<double> m,
                        const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < 3; ++k) out.snapshots[0].q[pad_v_ + k] += 0.9 * m[k];
    for (std::size_t k = 0; k < 3; ++k) m[k] *= 0.5;
    out.action[0] += 0.1 * m[3];
    m[3] *= 0.3;
  }
  void restart_state(const TaskView& view, std::span<double> q,
                     std::span<double> v) const override {
    for (std::size_t k = 0; k < 2; ++k) q[pad_ + k] = 0.2 * q[pad_ + k] + 0.7 * view.task_state[k];
    v[pad_v_] = 0.1 * v[pad_v_] + 0.02 * view.action[1] + 0.05 * view.task_state[3];
  }
  void restart_state_vjp(const TaskView&, std::span<const double> q, std::span<const double> v,
                         const ViewCotangent& out) const override {
    for (std::size_t i = 0; i < q.size(); ++i) {
      const bool placed = i == pad_v_ || i == pad_v_ + 1;
      out.snapshots[0].q[i] += placed ? 0.2 * q[i] : q[i];
      if (placed) out.task_state[i - pad_v_] += 0.7 * q[i];
      out.snapshots[0].v[i] += i == pad_v_ ? 0.1 * v[i] : v[i];
    }
    out.action[1] += 0.02 * v[pad_v_];
    out.task_state[3] += 0.05 * v[pad_v_];
  }
  void controls(const TaskView& view, int step, std::span<double> u) const override {
    for (std::size_t k = 0; k < 3; ++k)
      u[k] = view.action[k] * view.action[k] * (1 + 0.1 * step) + 0.2 * view.task_state[k] -
             0.3 * view.now().v[pad_v_ + k] - view.now().q[pad_ + k];
  }
  void controls_vjp(const TaskView& view, int step, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < 3; ++k) {
      out.action[k] += weight[k] * 2 * view.action[k] * (1 + 0.1 * step);
      out.task_state[k] += 0.2 * weight[k];
      out.snapshots[0].v[pad_v_ + k] -= 0.3 * weight[k];
      out.snapshots[0].q[pad_v_ + k] -= weight[k];
    }
  }
  void observe(const TaskView&, std::span<double> o) const override {
    std::fill(o.begin(), o.end(), 0.0);
  }
  StepOutcome evaluate(const TaskView& view) const override {
    double sum = view.task_state[3] * view.action[2];
    for (const Snapshot& m : view.snapshots) {
      for (const double f : m.tactile) sum += 50 * f * f;
      for (const double v : m.v) sum += v * v;
      sum += m.q[ball_] + 3 * m.q[pad_ + 2];
    }
    return {sum, false, false};
  }
  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    out.task_state[3] += weight * view.action[2];
    out.action[2] += weight * view.task_state[3];
    for (std::size_t m = 0; m < view.snapshots.size(); ++m) {
      for (std::size_t i = 0; i < view.snapshots[m].tactile.size(); ++i)
        out.snapshots[m].tactile[i] += weight * 100 * view.snapshots[m].tactile[i];
      for (std::size_t i = 0; i < view.snapshots[m].v.size(); ++i)
        out.snapshots[m].v[i] += weight * 2 * view.snapshots[m].v[i];
      out.snapshots[m].q[dof("ball_joint")] += weight;
      out.snapshots[m].q[pad_v_ + 2] += 3 * weight;
    }
  }
  void scripted(const TaskView& view, std::span<const double>, std::span<double> a) const override {
    a[0] = 0.3 * std::sin(double(view.actions + view.episode));
    a[1] = 0.2;
    a[2] = 0.5;
  }

 private:
  std::size_t pad_, pad_v_, ball_;
};

std::unique_ptr<Task> everything(const Scene& scene) { return std::make_unique<Everything>(scene); }
Scene scene_of(const std::string& name) {
  return read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene;
}

TEST(TaskGradients, WhateverATaskLooksAtHasItsShare) {
  const auto task = everything(scene_of("rolling_ball_small"));
  const Policy policy(*task, PolicyKind::scripted);
  CheckOptions options;
  options.entries = 8;
  options.stepper.tolerance = 1e-12;
  const GradientCheck check = check_task_gradient(*task, everything, actions_of(policy), options);
  expect_agreement(check, 1e-6);
  for (const CheckedInput& c : check.inputs) EXPECT_GT(c.norm, 0) << c.name;
}

TaskGradients gradients(const Task& task, std::int64_t episodes, int threads, double tape_bytes,
                        std::int64_t actions = 0) {
  const Policy policy(task, PolicyKind::scripted);
  TapeOptions options;
  options.length = actions;
  options.precision = Precision::mixed;
  options.threads = threads;
  options.parameters = true;
  options.tape_bytes = tape_bytes;
  return task_gradients(task, actions_of(policy), 2, {0, episodes}, options);
}

void expect_same(const TaskGradients& a, const TaskGradients& b) {
  EXPECT_EQ(a.value, b.value);
  EXPECT_EQ(a.length, b.length);
  EXPECT_EQ(a.action, b.action);
  EXPECT_EQ(a.u, b.u);
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.v, b.v);
  EXPECT_EQ(a.parameters, b.parameters);
}

TEST(TaskGradients, ThreadsAndNeighboursChangeNothing) {
  const auto task = task_named("box_pushing");
  const TaskGradients one = gradients(*task, 40, 1, 1e9, 30),
                      three = gradients(*task, 40, 3, 1e9, 30);
  expect_same(one, three);
  const TaskGradients few = gradients(*task, 3, 1, 1e9, 30);
  for (std::size_t i = 0; i < few.u.size(); ++i) EXPECT_EQ(few.u[i], one.u[i]);
  EXPECT_EQ(one.recomputed_steps, 0);
}

/// Includes restarts, ends at different times and a scheme of two steps.
TEST(TaskGradients, CheckpointsChangeNothing) {
  expect_same(gradients(*task_named("ball_rolling_small"), 18, 1, 1e9, 40),
              gradients(*task_named("ball_rolling_small"), 18, 1, 6e5, 40));
  const auto task = everything(scene_of("rolling_ball_small"));
  const TaskGradients stored = gradients(*task, 18, 1, 1e9), again = gradients(*task, 18, 1, 2.2e5);
  EXPECT_EQ(stored.recomputed_steps, 0);
  EXPECT_EQ(again.recomputed_steps, 2 * 12 * 5);
  expect_same(stored, again);
  const auto insertion = task_named("insertion");
  const TaskGradients ended = gradients(*insertion, 5, 1, 1e9, 6);
  EXPECT_NE(*std::min_element(ended.length.begin(), ended.length.end()),
            *std::max_element(ended.length.begin(), ended.length.end()));
  const TaskGradients ended_again = gradients(*insertion, 5, 1, 6e5, 6);
  EXPECT_GT(ended_again.recomputed_steps, 0);
  expect_same(ended, ended_again);
}

TEST(TaskGradients, TheEpisodesAreThoseOfAVectorTask) {
  for (const char* name : {"box_pushing", "insertion_translation"}) {
    Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/" + task_spec(name).scene).scene;
    scene.solver.tolerance = kGradientTolerance;  // a VectorTask's follows the step otherwise
    const auto task = make_task(name, scene);
    const std::int64_t actions = std::min(task->spec().horizon, 30);
    const TaskGradients g = gradients(*task, 18, 1, 1e9, actions);
    VectorOptions options;
    options.seed = 2;
    options.autoreset = false;
    VectorTask vector(*task, 18, options);
    const Policy policy(*task, PolicyKind::scripted);
    std::vector<double> chosen(18 * task->spec().action.size());
    for (std::int64_t a = 0; a < actions; ++a) {
      policy.act(vector, chosen);
      vector.step(chosen);
    }
    EXPECT_EQ(g.value, std::vector<double>(vector.returns().begin(), vector.returns().end()))
        << name;
    EXPECT_EQ(g.length, std::vector<std::int64_t>(vector.lengths().begin(), vector.lengths().end()))
        << name;
  }
}

TEST(TaskGradients, AnActionBeyondItsBoundsHasNoDerivative) {
  const auto task = task_named("dummy");
  TapeOptions options;
  options.length = 3;
  const auto g = task_gradients(
      *task,
      [](const TaskView& view, std::span<const double>, std::span<double> a) {
        a[0] = view.actions == 1 ? 0.6 : 0.5;
      },
      0, {0, 1}, options);
  EXPECT_NE(g.u[0], 0) << "on the bound it is that of its inside";
  EXPECT_EQ(g.u[1], 0);
  EXPECT_NE(g.u[2], 0);
  EXPECT_EQ(g.action[1], 0.6) << "as it was chosen";
}

TEST(TaskGradients, RefusesWhatItCannotDo) {
  const auto task = task_named("dummy");
  EXPECT_THROW(gradients(*task, 0, 1, 1e9), InputError);
  EXPECT_THROW(gradients(*task, 1, 0, 1e9), InputError);
  EXPECT_THROW(gradients(*task, 1, 1, 1e9, 41), InputError);
  EXPECT_THROW(gradients(*task, 1, 1, 1e3), InputError);
  EXPECT_THROW(
      task_gradients(
          *task, [](const TaskView&, std::span<const double>, std::span<double> a) { a[0] = NAN; },
          0, {0, 1}, {}),
      InputError);
}

/// The state of every lane after one more action, with its own change at the start.
struct Lanes {
  std::vector<std::vector<double>> q, v;
};

/// Returns the states after action `last`, if the state before it or the action itself is moved
/// lane by lane.
template <class Change>
Lanes after(const Task& task, std::int64_t last, const TaskActions& actions, const Change& change) {
  TaskRollout rollout(task, {{}, {}, 1e-12}, Precision::f64);
  rollout.start(2, std::vector<std::int64_t>(kernels::kBlock, 3));
  ActionRecord record(task);
  for (std::int64_t a = 0; a <= last; ++a) {
    rollout.choose(actions, record);
    if (a == last) change(rollout, record);
    rollout.begin(record);
    rollout.take_steps(nullptr);
    rollout.conclude();
  }
  Lanes out;
  for (int l = 0; l < rollout.lanes(); ++l) {
    out.q.emplace_back(std::size_t(task.model().nq()));
    out.v.emplace_back(std::size_t(task.model().nv()));
    rollout.batch().get_q(l, out.q.back());
    rollout.batch().get_v(l, out.v.back());
  }
  return out;
}

/// Compares columns of a row's Jacobian with differences, in v and in the coordinates before the
/// first quaternion.
void check_row(const Task& task, std::int64_t last) {
  const Policy policy(task, PolicyKind::random);
  const TaskActions actions = actions_of(policy);
  TaskRollout rollout(task, {{}, {}, 1e-12}, Precision::f64);
  rollout.start(2, std::vector<std::int64_t>(kernels::kBlock, 3));
  ActionRecord record(task);
  BlockTape tape(task.model(), rollout.integrator(), task.spec().steps_per_action);
  ActionJacobians jacobians(task, {{}, {}, 1e-12});
  for (std::int64_t a = 0; a <= last; ++a) {
    rollout.choose(actions, record);
    rollout.begin(record);
    rollout.take_steps(&tape);
    if (a == last) jacobians.evaluate(rollout, record, a, tape);
    rollout.conclude();
  }
  const RowJacobian& j = jacobians.of(5);
  const std::size_t nv = std::size_t(task.model().nv()), width = task.spec().action.size();
  std::size_t plain = 0;
  while (plain < nv && compiled(task.model()).links[plain].kind != kernels::JointKind::spherical)
    ++plain;  // one link each there
  double norm = 0;
  for (const double x : j.state) norm = std::max(norm, std::abs(x));
  for (const double x : j.others) norm = std::max(norm, std::abs(x));
  for (std::size_t column = 0; column < 2 * nv + width; ++column) {
    constexpr double kMove = 1e-6;
    const Lanes moved = after(task, last, actions, [&](TaskRollout& r, ActionRecord& asked) {
      for (int l = 0; l < 2; ++l) {
        const double e = l == 0 ? kMove : -kMove;
        const Snapshot now = view_of(r.batch(), r.data(), l).now();
        std::vector<double> q(now.q.begin(), now.q.end()), v(now.v.begin(), now.v.end());
        if (column < nv) displace(task.model(), q, static_cast<int>(column), e);
        if (column >= nv && column < 2 * nv) v[column - nv] += e;
        if (column >= 2 * nv) asked.chosen[std::size_t(l) * width + column - 2 * nv] += e;
        r.displace(l, q, v);
      }
    });
    for (std::size_t i = 0; i < nv; ++i) {
      const auto at = [&](std::size_t row) {
        return column < 2 * nv ? j.state[row * 2 * nv + column]
                               : j.others[row * width + column - 2 * nv];
      };
      if (i < plain) {
        EXPECT_NEAR(at(i), (moved.q[0][i] - moved.q[1][i]) / (2 * kMove), 2e-5 * norm)
            << "q " << i << " by " << column;
      }
      EXPECT_NEAR(at(nv + i), (moved.v[0][i] - moved.v[1][i]) / (2 * kMove), 2e-5 * norm)
          << "v " << i << " by " << column;
    }
  }
}

TEST(RowJacobians, AreThoseOfDifferences) {
  check_row(*task_named("box_pushing"), 7);
  check_row(*task_named("cap_opening_blind"), 4);
  check_row(*task_named("insertion_translation"), 1);
  check_row(*everything(scene_of("rolling_ball_small")), 3);
}

}  // namespace
}  // namespace tangere
