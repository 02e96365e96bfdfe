// SPDX-License-Identifier: Apache-2.0
// Tests what a TaskTape promises of its episodes: those of a VectorTask, whatever the threads, the
// neighbours and the tapes; ends and failures; and what it refuses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/step/displacement.hpp"
#include "tasks/run/policy.hpp"
#include "tests/tasks/gradients/tape_sweep.hpp"

namespace tangere {
namespace {

using testing::expect_same_rows;
using testing::keyed;
using testing::keyed_incoming;
using testing::kTapeSeed;
using testing::rows_of;
using testing::scripted_actions;
using testing::sweep_of;
using testing::Swept;
using testing::tape_options;
using testing::task_named;
using Row = std::vector<double>;

Scene small_ball() { return read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml").scene; }

enum class Watching { after_opening, at_once, without_derivative };

/// A pad that presses a ball. It observes products of two moments, the memory, the last action and
/// the field. In episode 3 the third action gives no number.
class Watched : public Task {
 public:
  Watched(const Scene& scene, Watching how, std::int64_t lost = 3)
      : Task(scene, declare(how)),
        how_(how),
        lost_(lost),
        pad_(coordinate("pad_joint")),
        pad_v_(dof("pad_joint")) {}

  static TaskSpec declare(Watching how) {
    TaskSpec spec = task_spec("ball_rolling_small");
    spec.name = "watched";
    spec.observations = {{"numbers", {4}, "1", "what is watched"}};
    spec.snapshots = {3, 5};
    spec.horizon = 6;
    spec.warm_up = how == Watching::after_opening;
    spec.task_state = 1;
    return spec;
  }
  void start(const TaskStart& s) const override {
    s.q[pad_ + 2] = -0.0152;  // it touches at once
    s.task_state[0] = 0.3;
  }
  void begin_action(const TaskView& view, std::span<double> m) const override {
    m[0] = 0.5 * m[0] + view.action[0] + 10 * view.now().q[pad_];
  }
  void begin_action_vjp(const TaskView&, std::span<double> m,
                        const ViewCotangent& out) const override {
    out.action[0] += m[0];
    out.snapshots[0].q[pad_v_] += 10 * m[0];
    m[0] *= 0.5;
  }
  void controls(const TaskView& view, int, std::span<double> u) const override {
    for (std::size_t k = 0; k < 3; ++k) u[k] = view.action[k];
    u[2] += 0.2;
    if (view.episode == lost_ && view.actions == 2) u[0] = NAN;
  }
  void controls_vjp(const TaskView&, int, std::span<const double> weight,
                    const ViewCotangent& out) const override {
    for (std::size_t k = 0; k < 3; ++k) out.action[k] += weight[k];
  }
  void observe(const TaskView& view, std::span<double> o) const override {
    const Snapshot &first = view.snapshots.front(), &now = view.now();
    o[0] = first.q[pad_ + 2] * now.v[pad_v_ + 2] * 100;
    o[1] = 0;
    for (const double f : now.tactile) o[1] += 100 * f * f;
    o[2] = view.task_state[0] * (1 + view.action[1]);
    o[3] = std::sin(10 * now.q[pad_] + now.v[pad_v_ + 1]);
  }
  void observe_vjp(const TaskView& view, std::span<const double> w,
                   const ViewCotangent& out) const override {
    if (how_ == Watching::without_derivative) return Task::observe_vjp(view, w, out);
    const Snapshot &first = view.snapshots.front(), &now = view.now();
    const SnapshotCotangent &to_first = out.snapshots.front(), &to = out.snapshots.back();
    to_first.q[pad_v_ + 2] += w[0] * now.v[pad_v_ + 2] * 100;
    to.v[pad_v_ + 2] += w[0] * first.q[pad_ + 2] * 100;
    for (std::size_t i = 0; i < now.tactile.size(); ++i)
      to.tactile[i] += w[1] * 200 * now.tactile[i];
    out.task_state[0] += w[2] * (1 + view.action[1]);
    out.action[1] += w[2] * view.task_state[0];
    const double slope = w[3] * std::cos(10 * now.q[pad_] + now.v[pad_v_ + 1]);
    to.q[pad_v_] += 10 * slope;
    to.v[pad_v_ + 1] += slope;
  }
  StepOutcome evaluate(const TaskView& view) const override {
    return {view.now().q[pad_] + 0.1 * view.action[0] * view.action[0], false, false};
  }
  void reward_vjp(const TaskView& view, double weight, const ViewCotangent& out) const override {
    out.snapshots.back().q[pad_v_] += weight;
    out.action[0] += weight * 0.2 * view.action[0];
  }
  void scripted(const TaskView& view, std::span<const double>, std::span<double> a) const override {
    a[0] = 0.3 * std::sin(double(view.actions + view.episode));
    a[1] = 0.2;
    a[2] = 0.1;
  }

 private:
  Watching how_;
  std::int64_t lost_;
  std::size_t pad_, pad_v_;
};

/// Σ of keyed numbers times what environment e of the tape shows, over `actions` given actions.
double watched_sum(TaskTape& tape, int e, const Row& q, const Row& v, const Row& given,
                   std::int64_t actions) {
  const std::size_t seen = tape.task().spec().observation_size(),
                    width = tape.task().spec().action.size();
  tape.reset(kTapeSeed, 0);
  Row all_q(tape.q().begin(), tape.q().end()), all_v(tape.v().begin(), tape.v().end());
  std::copy(q.begin(), q.end(), all_q.begin() + std::ptrdiff_t(std::size_t(e) * q.size()));
  std::copy(v.begin(), v.end(), all_v.begin() + std::ptrdiff_t(std::size_t(e) * v.size()));
  tape.displace(all_q, all_v);
  double sum = 0;
  const auto add = [&](std::int64_t step) {
    for (std::size_t k = 0; k < seen; ++k)
      sum += keyed_incoming(e, step, k) * tape.observations()[std::size_t(e) * seen + k];
    if (step > 0) sum += keyed_incoming(e, step, seen) * tape.rewards()[std::size_t(e)];
  };
  add(0);
  const std::size_t row = std::size_t(tape.environments()) * width;
  for (std::int64_t t = 0; t < actions; ++t) {
    tape.step(std::span(given).subspan(std::size_t(t) * row, row));
    add(t + 1);
  }
  return sum;
}

/// Every derivative that comes out of a tape against differences, also of an episode that fails in
/// its third action and goes on showing its last state, and of one beside it.
void check_by_differences(Watching how) {
  const Watched task(small_ball(), how);
  constexpr std::int64_t kActions = 5;
  constexpr int kEnvironments = 5;
  TapeOptions options = tape_options(kActions);
  options.stepper.tolerance = 1e-12;
  options.precision = Precision::f64;
  TaskTape tape(task, kEnvironments, options, kTapeSeed);
  const std::size_t nq = std::size_t(task.model().nq()), nv = std::size_t(task.model().nv()),
                    width = 3;
  const Row first_q(tape.q().begin(), tape.q().end()), first_v(tape.v().begin(), tape.v().end());
  Row given;
  {
    TaskTape probe(task, kEnvironments, options, kTapeSeed);
    for (std::int64_t t = 0; t < kActions; ++t) {
      const Row a = scripted_actions(probe);
      given.insert(given.end(), a.begin(), a.end());
      probe.step(a);
    }
  }
  const Swept swept = sweep_of(tape, kActions, keyed_incoming);
  EXPECT_TRUE(failed(tape.status(3)));
  EXPECT_EQ(tape.alive()[3], 0);
  EXPECT_EQ(tape.truncated()[3], 1);
  EXPECT_EQ(tape.alive()[2], 1);
  for (const int e : {3, 2}) {
    const Row q(first_q.begin() + std::ptrdiff_t(std::size_t(e) * nq),
                first_q.begin() + std::ptrdiff_t(std::size_t(e + 1) * nq)),
        v(first_v.begin() + std::ptrdiff_t(std::size_t(e) * nv),
          first_v.begin() + std::ptrdiff_t(std::size_t(e + 1) * nv));
    const auto compare = [&](double slope, const std::string& what, double size,
                             const std::function<double(double)>& at) {
      double best = HUGE_VAL, of_best = 0;
      for (const double h : {1e-5, 1e-6, 1e-7, 1e-8, 4e-9}) {
        const double difference = (at(h) - at(-h)) / (2 * h);
        if (std::abs(difference - slope) < best)
          best = std::abs(difference - slope), of_best = difference;
      }
      EXPECT_LE(best, 1e-6 * size) << what << " of environment " << e << ": " << slope << ", by "
                                   << "differences " << of_best;
    };
    const auto norm = [](const Row& x) {
      double square = 0;
      for (const double y : x) square += y * y;
      return std::sqrt(square);
    };
    const Row action_bar = rows_of(swept.action_bar, kEnvironments, std::size_t(e), kActions),
              q_bar = rows_of(swept.q_bar, kEnvironments, std::size_t(e), 1),
              v_bar = rows_of(swept.v_bar, kEnvironments, std::size_t(e), 1);
    EXPECT_GT(norm(action_bar), 0);
    for (std::size_t t = 0; t < std::size_t(kActions); ++t)
      for (std::size_t k = 0; k < width; ++k) {
        compare(action_bar[t * width + k], "action " + std::to_string(t) + " " + std::to_string(k),
                norm(action_bar), [&](double h) {
                  Row moved = given;
                  moved[(t * kEnvironments + std::size_t(e)) * width + k] += h;
                  return watched_sum(tape, e, q, v, moved, kActions);
                });
        if (e == 3 && t > 2) {
          EXPECT_EQ(action_bar[t * width + k], 0) << "after the failure";
        }
      }
    for (std::size_t i = 0; i < 3; ++i) {  // the pad's; the ball stands on stiff ground
      compare(q_bar[i], "q " + std::to_string(i), norm(q_bar), [&](double h) {
        Row moved = q;
        displace(task.model(), moved, int(i), h);
        return watched_sum(tape, e, moved, v, given, kActions);
      });
      compare(v_bar[i], "v " + std::to_string(i), norm(v_bar), [&](double h) {
        Row moved = v;
        moved[i] += h;
        return watched_sum(tape, e, q, moved, given, kActions);
      });
    }
  }
}

TEST(TapeEpisodes, WhateverATaskWatchesHasItsShare) { check_by_differences(Watching::at_once); }
TEST(TapeEpisodes, AnOpeningCountsAsGivenBeforeItsEnd) {
  check_by_differences(Watching::after_opening);
}

TEST(TapeEpisodes, AreThoseOfAVectorTask) {
  for (const char* name : {"box_pushing", "insertion_translation", "ball_rolling_small"}) {
    Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/" + task_spec(name).scene).scene;
    scene.solver.tolerance = kGradientTolerance;  // a VectorTask's follows the step otherwise
    const auto task = make_task(name, scene);
    const std::int64_t actions = std::min(task->spec().horizon, 20);
    TaskTape tape(*task, 18, tape_options(actions, 2), kTapeSeed, 5);
    VectorOptions as_vector;
    as_vector.seed = kTapeSeed;
    as_vector.first_episode = 5;
    as_vector.autoreset = false;
    VectorTask vector(*task, 18, as_vector);
    const auto expect_same = [&] {
      const auto same = [&](auto a, auto b) {
        EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end())) << name;
      };
      same(tape.observations(), vector.observations());
      same(tape.rewards(), vector.rewards());
      same(tape.terminated(), vector.terminated());
      same(tape.truncated(), vector.truncated());
      same(tape.success(), vector.success());
      for (int e = 0; e < 18; ++e) {
        EXPECT_EQ(tape.status(e), vector.status(e));
        const std::size_t nq = std::size_t(task->model().nq());
        same(tape.q().subspan(std::size_t(e) * nq, nq), vector.view(e).now().q);
      }
    };
    expect_same();
    for (std::int64_t t = 0; t < actions; ++t) {
      const Row a = scripted_actions(tape);
      tape.step(a);
      vector.step(a);
      expect_same();
    }
    tape.reset(kTapeSeed + 1, 5);
    vector.reset(kTapeSeed + 1);
    expect_same();
  }
}

TEST(TapeEpisodes, ThreadsNeighboursAndTapesChangeNothing) {
  for (const char* name : {"box_pushing", "insertion"}) {
    const auto task = task_named(name);
    const std::int64_t actions = name == std::string("insertion") ? 4 : 15;
    const double least = testing::least_tape_bytes(*task, 37, tape_options(actions));
    TaskTape many(*task, 37, tape_options(actions, 3), kTapeSeed),
        few(*task, 3, tape_options(actions), kTapeSeed),
        again(*task, 37, tape_options(actions, 2, least), kTapeSeed);
    const Swept of_many = sweep_of(many, actions, keyed_incoming),
                of_few = sweep_of(few, actions, keyed_incoming);
    for (std::size_t e = 0; e < 3; ++e)
      expect_same_rows(of_many, 37, e, of_few, 3, e, std::size_t(actions));
    EXPECT_EQ(sweep_of(again, actions, keyed_incoming), of_many) << name;
    EXPECT_GT(again.recomputed_steps(), 0) << name;
    // The same once more on the same object.
    many.reset(kTapeSeed, 0);
    EXPECT_EQ(sweep_of(many, actions, keyed_incoming), of_many) << name;
    // Another first episode shifts the environments.
    TaskTape late(*task, 2, tape_options(actions), kTapeSeed, 20);
    const Swept of_late = sweep_of(late, actions, [](int e, std::int64_t t, std::size_t k) {
      return keyed_incoming(e + 20, t, k);
    });
    for (std::size_t e = 0; e < 2; ++e)
      expect_same_rows(of_late, 2, e, of_many, 37, e + 20, std::size_t(actions));
  }
}

TEST(TapeEpisodes, NeighboursThatFailOrReceiveNoNumbersChangeNothing) {
  const Watched sound(small_ball(), Watching::at_once, -1), breaks(small_ball(), Watching::at_once);
  for (const double tape_bytes : {1e9, testing::least_tape_bytes(sound, 18, tape_options(6))}) {
    TaskTape whole(sound, 18, tape_options(6, 1, tape_bytes), kTapeSeed),
        broken(breaks, 18, tape_options(6, 1, tape_bytes), kTapeSeed);
    const Swept of_whole = sweep_of(whole, 6, keyed_incoming);
    const Swept of_broken = sweep_of(broken, 6, [](int e, std::int64_t t, std::size_t k) {
      return e == 5 && t == 4 ? NAN : keyed_incoming(e, t, k);
    });
    EXPECT_EQ(whole.recomputed_steps() > 0, tape_bytes < 1e9);
    EXPECT_TRUE(failed(broken.status(3)));
    for (std::size_t e = 0; e < 18; ++e)
      if (e != 3 && e != 5) expect_same_rows(of_whole, 18, e, of_broken, 18, e, 6);
    EXPECT_TRUE(std::isnan(rows_of(of_broken.action_bar, 18, 5, 6)[0]));
    for (const double x : rows_of(of_broken.action_bar, 18, 3, 6)) EXPECT_TRUE(std::isfinite(x));
  }
}

/// What an ended episode goes on showing counts for its last action.
TEST(TapeEpisodes, EndedEpisodesKeepWhatTheyShow) {
  const auto task = task_named("insertion");
  constexpr std::int64_t kActions = 8;
  constexpr std::size_t kEpisodes = 18;
  TaskTape tape(*task, int(kEpisodes), tape_options(kActions), kTapeSeed);
  std::vector<std::int64_t> last(kEpisodes, 0);
  for (std::int64_t t = 0; t < kActions; ++t) {
    std::vector<double> actions = Row(kEpisodes * 3);
    for (int e = 0; e < int(kEpisodes); ++e)
      task->scripted(tape.view(e), tape.observations().subspan(std::size_t(e) * 520, 520),
                     std::span(actions).subspan(std::size_t(e) * 3, 3));
    for (std::size_t e = 0; e < kEpisodes; ++e)
      if (tape.terminated()[e] != 0) actions[3 * e] = NAN;  // nobody looks at it
    tape.step(actions);
    for (std::size_t e = 0; e < kEpisodes; ++e) {
      if (tape.alive()[e] != 0) last[e] = t + 1;
      if (tape.alive()[e] == 0) {
        EXPECT_EQ(tape.rewards()[e], 0);
      }
    }
  }
  ASSERT_NE(*std::min_element(last.begin(), last.end()), kActions);
  ASSERT_EQ(*std::max_element(last.begin(), last.end()), kActions);
  // Everything at the end, or everything after an episode's last action: the same.
  const auto go_back = [&](bool at_the_end) {
    Row all;
    for (std::int64_t t = kActions; t-- > 0;) {
      Row by_o(kEpisodes * 520), action_bar(kEpisodes * 3), q_bar(kEpisodes * 12);
      for (std::size_t e = 0; e < kEpisodes; ++e)
        if (t + 1 == (at_the_end ? kActions : last[e])) {
          for (std::size_t k = 0; k < 520; ++k) by_o[e * 520 + k] = keyed(std::int64_t(e), 0, k);
          for (std::size_t k = 0; k < 12; ++k) q_bar[e * 12 + k] = keyed(std::int64_t(e), 1, k);
        }
      tape.reverse({.observation = by_o, .q = q_bar}, action_bar);
      all.insert(all.end(), action_bar.begin(), action_bar.end());
    }
    return all;
  };
  const Row late = go_back(true);
  tape.begin_reverse();
  EXPECT_EQ(go_back(false), late);
  EXPECT_GT(*std::max_element(late.begin(), late.end()), 0);
  for (std::size_t e = 0; e < kEpisodes; ++e)
    for (std::int64_t t = last[e]; t < kActions; ++t)
      EXPECT_EQ(late[(std::size_t(kActions - 1 - t) * kEpisodes + e) * 3], 0);
}

TEST(TapeEpisodes, AnActionBeyondItsBoundsHasNoDerivativeOnTape) {
  const auto task = task_named("dummy");
  TaskTape tape(*task, 3, tape_options(0), kTapeSeed);
  const Row actions{0.5, 0.6, -0.7}, ones(3, 1);
  tape.step(actions);
  Row action_bar(3);
  tape.reverse({.reward = ones}, action_bar);
  EXPECT_NE(action_bar[0], 0) << "on the bound it is that of its inside";
  EXPECT_EQ(action_bar[1], 0);
  EXPECT_EQ(action_bar[2], 0);
}

TEST(TapeEpisodes, MemoryGrowsByBlocksUpToTheLimitOfTapes) {
  const auto task = task_named("box_pushing");
  const double sixteen = TaskTape::bytes(*task, 16, tape_options(100)),
               many = TaskTape::bytes(*task, 160, tape_options(100)),
               fewer_actions = TaskTape::bytes(*task, 160, tape_options(10)),
               limited = TaskTape::bytes(*task, 160, tape_options(100, 1, 4e6));
  const auto stepper = double(Stepper::workspace_bytes(task->model()));  // of the one thread
  EXPECT_NEAR(many - stepper, 10 * (sixteen - stepper), 1);
  EXPECT_LT(limited, many);
  EXPECT_LT(fewer_actions, many);
  EXPECT_GT(many, 160 * 100 * 5 * 8.0 * (task->model().nq() + task->model().nv())) << "the states";
}

void expect_refusal(const std::function<void()>& call, const std::string& part) {
  try {
    call();
    ADD_FAILURE() << "was not refused; expected: " << part;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
  }
}

TEST(TapeEpisodes, MisuseIsRefused) {
  const auto task = task_named("dummy");
  EXPECT_THROW(TaskTape(*task, 0), InputError);
  EXPECT_THROW(TaskTape(*task, 1, tape_options(41)), InputError);
  EXPECT_THROW(TaskTape(*task, 1, tape_options(-1)), InputError);
  EXPECT_THROW(TaskTape(*task, 1, tape_options(3, 0)), InputError);
  EXPECT_THROW(TaskTape(*task, 1, tape_options(3, 1, NAN)), InputError);
  TaskTape tape(*task, 2, tape_options(2), kTapeSeed);
  Row actions(2), action_bar(2), two(2), wrong(3);
  const Row q(tape.q().begin(), tape.q().end()), v(2 * std::size_t(task->model().nv()));
  expect_refusal([&] { tape.reverse({}, action_bar); }, "one more reverse");
  expect_refusal([&] { tape.step(wrong); }, "3 numbers of actions; expected 2");
  actions[1] = INFINITY;
  expect_refusal([&] { tape.step(actions); }, "number 0 of action 0 of environment 1 is inf");
  actions[1] = 0;
  expect_refusal([&] { tape.displace(q, {}); }, "0 numbers of v");
  tape.step(actions);
  expect_refusal([&] { tape.displace(q, v); }, "after the first step");
  expect_refusal([&] { tape.reverse_start({}, {}); }, "1 of 1 actions left");
  tape.step(actions);  // refused calls have left no trace
  expect_refusal([&] { tape.step(actions); }, "action 2 on a tape of 2 actions");
  expect_refusal([&] { tape.reverse({wrong}, action_bar); }, "3 numbers of derivatives by obs");
  expect_refusal([&] { tape.reverse({{}, wrong}, action_bar); }, "derivatives by rewards");
  expect_refusal([&] { tape.reverse({}, wrong); }, "derivatives by actions");
  expect_refusal([&] { tape.reverse({.q = wrong}, action_bar); }, "derivatives by q");
  expect_refusal([&] { tape.reverse({.v = wrong}, action_bar); }, "derivatives by v");
  tape.reverse({.reward = two}, action_bar);
  expect_refusal([&] { tape.step(actions); }, "has been reversed");
  tape.reverse({.reward = two}, action_bar);
  expect_refusal([&] { tape.reverse({.reward = two}, action_bar); }, "one more reverse");
  expect_refusal([&] { tape.reverse_start({}, {.q = wrong, .v = {}}); },
                 "derivatives by the first q");
  expect_refusal([&] { tape.reverse_start({}, {.q = {}, .v = {}, .parameters = wrong}); },
                 "the scene's numbers");
  tape.reverse_start({}, {});
  expect_refusal([&] { tape.reverse_start({}, {}); }, "a second end");
  tape.begin_reverse();
  tape.reverse({.reward = two}, action_bar);
  tape.reset(1, 0);
  tape.step(actions);
  const Row seen(tape.observations().begin(), tape.observations().end());
  tape.reset(1, 0, false);
  tape.step(actions);
  EXPECT_EQ(Row(tape.observations().begin(), tape.observations().end()), seen);
  expect_refusal([&] { tape.reverse({}, action_bar); }, "without a record");
}

TEST(TapeEpisodes, ATaskWithoutADerivativeOfItsObservationsIsNamed) {
  const Watched task(small_ball(), Watching::without_derivative);
  TaskTape tape(task, 20, tape_options(2, 2), kTapeSeed);
  Row ones(20, 1), by_o(80, 1), action_bar(60);
  tape.step(scripted_actions(tape));
  tape.reverse({.reward = ones}, action_bar);  // rewards need none
  tape.begin_reverse();
  expect_refusal([&] { tape.reverse({by_o}, action_bar); },
                 "task watched has no derivative of its observations; expected Task::observe_vjp");
  expect_refusal([&] { tape.reverse({.reward = ones}, action_bar); }, "has failed halfway");
  expect_refusal([&] { tape.begin_reverse(); }, "has failed halfway");
  expect_refusal([&] { tape.step(Row(60)); }, "has failed halfway");
  tape.reset(kTapeSeed, 0);
  tape.step(scripted_actions(tape));
}

}  // namespace
}  // namespace tangere
