// SPDX-License-Identifier: Apache-2.0
// Tests for every task that going back on a TaskTape is the transpose of going forward, and that it
// is the gradient of the return where only rewards count. Its other promises are tested in
// tape_episodes_test.cpp.
#include "tasks/gradients/task_tape.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/derivative/number_gradients.hpp"
#include "engine/model/random.hpp"
#include "engine/step/displacement.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/task_tangent.hpp"
#include "tests/tasks/gradients/observed_change.hpp"
#include "tests/tasks/gradients/tape_sweep.hpp"

namespace tangere {
namespace {

using Numbers = std::vector<double>;
using testing::keyed;
using testing::kTapeSeed;
using testing::rows_of;
using testing::scripted_actions;
using testing::sweep_of;
using testing::Swept;
using testing::tape_options;
using testing::task_named;

struct TapeCase {
  const char* task;
  std::int64_t actions;
};
void PrintTo(const TapeCase& c, std::ostream* out) { *out << c.task << " " << c.actions; }

class EveryTape : public ::testing::TestWithParam<TapeCase> {};
class EveryOpenLoop : public ::testing::TestWithParam<TapeCase> {};

/// With derivatives by rewards alone, and all one, it is the gradient of the return, bit for bit,
/// with and without checkpoints.
TEST_P(EveryTape, WithRewardsAloneItIsTheGradientOfTheReturn) {
  const auto [name, actions] = GetParam();
  const auto task = task_named(name);
  const int episodes = std::string(name).starts_with("stable_grasp") ? 10 : 18;
  TapeOptions options = tape_options(actions, 2);
  options.parameters = true;
  const std::size_t numbers = std::size_t(NumberGradients(task->model()).count()),
                    seen = task->spec().observation_size();
  const testing::Incoming one = [&](int, std::int64_t, std::size_t k) {
    return k == seen ? 1.0 : 0.0;
  };
  TaskTape tape(*task, episodes, options, kTapeSeed);
  const Swept swept = sweep_of(tape, actions, one, numbers);

  const TaskGradients g = task_gradients(
      *task,
      [&](const TaskView& view, std::span<const double> o, std::span<double> a) {
        task->scripted(view, o, a);
        for (std::size_t k = 0; k < a.size(); ++k)
          a[k] = std::clamp(0.8 * a[k], -0.4, 0.4) + 0.05 * keyed(view.episode, view.actions, k);
      },
      kTapeSeed, {0, episodes}, options);
  Numbers action_bar, value(std::size_t(episodes), 0.0);
  for (std::size_t e = 0; e < std::size_t(episodes); ++e) {
    const Numbers own = rows_of(swept.action_bar, std::size_t(episodes), e, std::size_t(actions));
    action_bar.insert(action_bar.end(), own.begin(), own.end());
    for (const double r : rows_of(swept.rewards, std::size_t(episodes), e, std::size_t(actions)))
      value[e] += r;
  }
  EXPECT_EQ(value, g.value);
  EXPECT_EQ(action_bar, g.u);
  EXPECT_EQ(swept.q_bar, g.q);
  EXPECT_EQ(swept.v_bar, g.v);
  EXPECT_EQ(swept.parameter_bar, g.parameters);
  EXPECT_GT(std::inner_product(action_bar.begin(), action_bar.end(), action_bar.begin(), 0.0), 0);
  EXPECT_EQ(tape.recomputed_steps(), 0);
  EXPECT_GT(g.newton_iterations, 0);

  options.tape_bytes = testing::least_tape_bytes(*task, episodes, options);
  TaskTape small(*task, episodes, options, kTapeSeed);
  EXPECT_EQ(sweep_of(small, actions, one, numbers), swept);
  if (actions > 3) {
    EXPECT_GT(small.recomputed_steps(), 0);
  }
}

/// Σ ō·δo + r̄ δr + q̄·δq + v̄·δv = Σ ā·δa + q̄₀·δq₀ + v̄₀·δv₀ + n̄·δn for any cotangents of what an
/// open loop shows and any changes of what goes in. The changes of what it shows come from dual
/// numbers, those of observations from differences of observe().
TEST_P(EveryOpenLoop, GoingBackIsTheTransposeOfGoingForward) {
  const auto [name, actions] = GetParam();
  const auto task = task_named(name);
  const std::size_t n = std::size_t(actions), width = task->spec().action.size(),
                    seen = task->spec().observation_size(), nv = std::size_t(task->model().nv());
  const NumberGradients parameters(task->model());
  const std::size_t numbers = std::size_t(parameters.count());
  const StepperOptions stepper{{}, {}, 1e-12};
  TapeOptions options = tape_options(actions);
  options.stepper = stepper;
  options.parameters = true;
  options.precision = Precision::f64;
  TaskTape tape(*task, 1, options);
  // The first episode that goes on for all actions, from a state without symmetry.
  Numbers q, v, played, action_bar(n * width);
  std::int64_t episode = -1;
  do {
    ASSERT_LT(++episode, 20);
    tape.reset(kTapeSeed, episode);
    q.assign(tape.q().begin(), tape.q().end());
    v.assign(tape.v().begin(), tape.v().end());
    if (std::string(name).starts_with("stable_grasp"))
      for (const auto& [dof, by] : {std::pair{6, 2e-4}, std::pair{7, 3e-4}, std::pair{11, 4e-3}})
        displace(task->model(), q, dof, by);
    tape.displace(q, v);
    played.clear();
    for (std::size_t t = 0; t < n; ++t) {
      const Numbers a = scripted_actions(tape);
      played.insert(played.end(), a.begin(), a.end());
      tape.step(a);
    }
  } while (tape.alive()[0] == 0);
  // Forces are small; large weights give them a share.
  const auto weights = [&](std::size_t count, std::int64_t action, double size) {
    Numbers w(count);
    for (std::size_t k = 0; k < count; ++k) w[k] = size * keyed(100, action, k);
    return w;
  };
  const auto by_o = [&](std::size_t t) { return weights(seen, std::int64_t(t), 10); };
  const auto by_r = [&](std::size_t t) { return weights(1, 1000 + std::int64_t(t), 1); };
  const auto q_bar = [&](std::size_t t) { return weights(nv, 2000 + std::int64_t(t), 10); };
  const auto v_bar = [&](std::size_t t) { return weights(nv, 3000 + std::int64_t(t), 1); };
  for (std::size_t t = n; t-- > 0;) {
    const Numbers to_q = q_bar(t + 1), to_v = v_bar(t + 1);
    const Numbers to_o = by_o(t + 1), to_r = by_r(t + 1);
    tape.reverse({to_o, to_r, to_q, to_v}, std::span(action_bar).subspan(t * width, width));
  }
  const bool opens = task->spec().warm_up;
  Numbers first_q(nv), first_v(nv), by_number(numbers);
  const Numbers to_q = q_bar(0), to_v = v_bar(0);
  const Numbers to_o = opens ? Numbers{} : by_o(0);
  tape.reverse_start({to_o, {}, to_q, to_v}, {first_q, first_v, by_number});

  TaskRollout rollout(*task, stepper, Precision::f64);
  rollout.start(kTapeSeed, {&episode, 1});
  rollout.displace(0, q, v);
  TaskTangent tangent(rollout, played, stepper);
  const Numbers da = weights(n * width, 4000, 1), dq = weights(nv, 4001, 1e-2),
                dv = weights(nv, 4002, 1);
  Numbers dn = weights(numbers, 4003, 1), rows(std::size_t(parameter_rows(task->model())));
  for (std::size_t k = 0; k < numbers; ++k) dn[k] *= parameters.infos()[k].value;
  parameters.spread(dn, rollout.batch(), 0, rows);
  const auto dot = [](const Numbers& a, const Numbers& b) {
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
  };
  const auto observed = [&](const TaskView& view, const ViewTangent& change) {
    return testing::observed_change(*task, view, change);
  };
  tangent.start(dq, dv);
  double forward = dot(to_q, dq) + dot(to_v, dv);
  if (!opens) {
    const ViewTangent change = tangent.seen_at_start(rows);
    forward += dot(by_o(0), observed(tangent.start_view(), change));
  }
  for (std::size_t t = 0; t < n; ++t) {
    forward += by_r(t + 1)[0] * tangent.take(std::span(da).subspan(t * width, width), rows);
    forward += dot(by_o(t + 1), observed(tangent.view(), tangent.seen()));
    forward +=
        dot(q_bar(t + 1), tangent.seen().q.back()) + dot(v_bar(t + 1), tangent.seen().v.back());
  }
  const double parts[] = {dot(action_bar, da), dot(first_q, dq), dot(first_v, dv),
                          dot(by_number, dn)};
  double back = 0, size = 0;
  for (const double part : parts) back += part, size += std::abs(part);
  EXPECT_NEAR(forward, back, 1e-8 * size) << "by actions " << parts[0] << ", q " << parts[1]
                                          << ", v " << parts[2] << ", numbers " << parts[3];
  EXPECT_NE(parts[0], 0);
  EXPECT_NE(parts[3], 0);
}

constexpr TapeCase kCases[] = {
    {"dummy", 20},
    {"ball_rolling_small", 20},
    {"box_pushing", 20},
    {"box_pushing_privileged", 12},
    {"box_pushing_reduced", 12},
    {"cap_opening", 8},
    {"cap_opening_blind", 8},
    {"stable_grasp", 2},
    {"insertion", 3},
    {"insertion_translation", 2},
    {"insertion_rotation", 2},
    {"box_pushing_elastic", 12},
    {"stable_grasp_elastic", 2},
    {"insertion_elastic", 2},
    // EveryTape is without these: a gel's steps take long.
    {"stable_grasp_gel", 2},
    {"insertion_gel", 2},
};
std::string name_of(const ::testing::TestParamInfo<TapeCase>& given) { return given.param.task; }

INSTANTIATE_TEST_SUITE_P(Tasks, EveryTape,
                         ::testing::ValuesIn(std::begin(kCases), std::end(kCases) - 2), name_of);
INSTANTIATE_TEST_SUITE_P(Tasks, EveryOpenLoop, ::testing::ValuesIn(kCases), name_of);

}  // namespace
}  // namespace tangere
