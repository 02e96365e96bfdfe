// SPDX-License-Identifier: Apache-2.0
// Tests what tasks draw, their rewards, and policies.
#include <gmock/gmock.h>

#include <algorithm>
#include <numbers>
#include <numeric>

#include "engine/model/random.hpp"
#include "tests/tasks/task_check.hpp"
#include "tests/tasks/task_starts.hpp"

namespace tangere {
namespace {

using testing::column;
using testing::kDraws;
using testing::kUnlikely;
using testing::OwnView;
using testing::Start;
using testing::starts;
using testing::task_named;
using testing::uniform_distance;

TEST(BoxPushing, StartsFollowTheirDistributions) {
  const auto all = starts(*task_named("box_pushing"));
  EXPECT_LT(uniform_distance(column(all, [](const Start& s) { return s.q[4]; }), -0.02, 0.02),
            kUnlikely);
  EXPECT_LT(uniform_distance(column(all, [](const Start& s) { return s.memory[0]; }), 0.2, 0.3),
            kUnlikely);
  EXPECT_LT(uniform_distance(column(all, [](const Start& s) { return s.memory[1]; }), -0.2, 0.2),
            kUnlikely);
  const double spread = std::numbers::pi / 16;
  EXPECT_LT(
      uniform_distance(
          column(all, [](const Start& s) { return s.memory[2] - std::numbers::pi * s.memory[1]; }),
          -spread, spread),
      kUnlikely);
  for (const Start& s : all) ASSERT_EQ(s.q[1], -0.001) << "the gripper, 1 mm back";
}

TEST(BoxPushing, IsPushedByOthersHalfOfTheTime) {
  const auto task = task_named("box_pushing");
  std::vector<double> memory(5), fx, fy;
  int pushed = 0;
  for (std::int64_t episode = 0; episode < kDraws; ++episode) {
    task->begin_action({1, episode, 20, memory, {}, {}}, memory);
    if (memory[3] == 0 && memory[4] == 0) continue;
    ++pushed;
    fx.push_back(memory[3]);
    fy.push_back(memory[4]);
    const std::vector<double> before = memory;
    task->begin_action({1, episode, 24, memory, {}, {}}, memory);
    ASSERT_EQ(memory, before) << "a push lasts ten actions";
  }
  EXPECT_NEAR(double(pushed) / kDraws, 0.5, 2.58 * 0.5 / std::sqrt(kDraws));
  EXPECT_LT(uniform_distance(fx, -1, 1), kUnlikely);
  EXPECT_LT(uniform_distance(fy, -1, 1), kUnlikely);
}

TEST(BoxPushing, PaysWhatThePaperSays) {
  const auto task = task_named("box_pushing");
  OwnView own(*task);
  own.memory = {0.2, 0.1, 0.3, 0, 0};
  own.action = {std::tanh(1), std::tanh(-2), std::tanh(0.5)};
  own.q[0] = {0.1,
              0,
              0,
              0.13,
              0.12,
              0,
              0.3 + std::numbers::pi / 18};  // 0.05 + 0.13: 20 mm short, 20 mm left, 10 degrees
  own.end_effectors[0] = {0.1, 0.2, 0.03, 0.11, 0.22, 0.5};  // 10 mm and 20 mm apart
  const StepOutcome verdict = task->evaluate(own.view());
  EXPECT_NEAR(verdict.reward, -0.01 * (4 + 4) - 0.1 * 4 - (0.25 + 1) - 0.1 * 5.25, 1e-12);
  EXPECT_FALSE(verdict.terminated || verdict.success);
  std::vector<double> o(task->spec().observation_size());
  task->observe(own.view(), o);
  EXPECT_NEAR(o[0], std::cos(0.1) * 0.1 + std::sin(0.1) * -0.1, 1e-15);
  EXPECT_NEAR(o[1], std::cos(0.1) * -0.1 - std::sin(0.1) * 0.1, 1e-15);
  EXPECT_NEAR(o[2], 0.2, 1e-15);
  std::vector<double> u(6);
  task->controls(own.view(), 0, u);
  EXPECT_THAT(u, ::testing::ElementsAre(std::tanh(1), std::tanh(-2), std::tanh(0.5), 0, 0, 0));
}

TEST(BallRolling, GoalsFollowTheirDistribution) {
  const auto all = starts(*task_named("ball_rolling_small"));
  for (std::size_t k = 0; k < 2; ++k)
    EXPECT_LT(
        uniform_distance(column(all, [=](const Start& s) { return s.memory[k] - s.q[3 + k]; }),
                         -0.01, 0.01),
        kUnlikely);
}

TEST(StableGrasp, BarsBalanceWhereTheyShallAndWeighWhatTheyShall) {
  const auto all = starts(*task_named("stable_grasp"));
  const auto sum = [](const Start& s) {
    return std::accumulate(s.varying.begin(), s.varying.end(), 0.0);
  };
  const auto centre = [&](const Start& s) {
    double moment = 0;
    for (std::size_t b = 0; b < s.varying.size(); ++b) moment += s.varying[b] * (double(b) + 0.5);
    return moment / sum(s);
  };
  EXPECT_LT(uniform_distance(column(all, centre), 1, 10), kUnlikely);
  EXPECT_LT(uniform_distance(column(all, sum), 3000, 7000), kUnlikely);
  EXPECT_LT(
      uniform_distance(
          column(all, [&](const Start& s) { return s.varying[std::size_t(centre(s))]; }), 600, 700),
      kUnlikely);
  for (const Start& s : all) ASSERT_GT(*std::min_element(s.varying.begin(), s.varying.end()), 0);
}

/// Distance of the centre of mass from the bar's middle [m].
double offset_of(const Batch& batch, int e) {
  double moment = 0, sum = 0;
  for (int b = 0; b < 11; ++b) {
    const double density = batch.randomized_value(e, b);
    moment += density * (b - 5) * 0.025;
    sum += density;
  }
  return moment / sum;
}

/// For fields of shear (rows, cols) of both pads: the part that a common translation and rotation
/// explain, and the rotation.
struct Vortex {
  double explained = 0, rotation = 0;
};
Vortex vortex_of(std::span<const double> flow) {
  double fy = 0, fz = 0, moment = 0, square = 0, all = 0;
  constexpr int kPoints = 130;
  for (int pad = 0; pad < 2; ++pad)
    for (int p = 0; p < kPoints; ++p) {
      const int row = p / 10, col = p % 10;
      const double up = pad == 0 ? 1 : -1, z = up * (row - 6), y = 4.5 - col;
      const double a = up * flow[std::size_t(2 * pad * kPoints + p)],
                   b = -flow[std::size_t((2 * pad + 1) * kPoints + p)];
      fz += a, fy += b, moment += y * a - z * b, square += y * y + z * z, all += a * a + b * b;
    }
  const double turning = moment * moment / square;
  return {((fy * fy + fz * fz) / (2 * kPoints) + turning) / all, moment / square};
}

/// The paper's Fig. 3: a bar that is not held at its centre of mass turns, and more so the farther
/// away it is held. The pads read a vortex.
TEST(StableGrasp, TiltGrowsWithTheOffsetAndShearIsARotation) {
  const auto task = task_named("stable_grasp");
  constexpr int kEnvironments = 64;
  VectorTask vector(*task, kEnvironments);
  const std::size_t width = task->spec().observation_size();
  for (int e = 0; e < kEnvironments; ++e) {
    const double offset = offset_of(vector.batch(), e);
    const Vortex vortex = vortex_of(vector.observation(e));
    const auto flow = vector.observation(e);
    double longest = 0;
    for (std::size_t p = 0; p < width / 2; ++p) {
      const std::size_t at = p / 130 * 260 + p % 130;
      longest = std::max(longest, std::hypot(flow[at], flow[at + 130]));
    }
    EXPECT_NEAR(longest, 1, 1e-12) << "normalised over both pads";
    EXPECT_GT(vortex.explained, 0.8) << "offset " << offset;
    if (std::abs(offset) > 0.01) {
      EXPECT_LT(vortex.rotation * offset, 0) << "turned by its weight: the heavier side goes down";
    }
  }
  vector.step(
      std::vector<double>(kEnvironments, 0.0));  // in the middle again; the reward shows the tilt
  std::vector<std::pair<double, double>> by_offset;
  for (int e = 0; e < kEnvironments; ++e) {
    const double offset = std::abs(offset_of(vector.batch(), e)),
                 reward = vector.rewards()[std::size_t(e)];
    by_offset.emplace_back(offset, reward > 0 ? 0 : -reward / 10);
  }
  std::sort(by_offset.begin(), by_offset.end());
  double before = -1;
  constexpr int kQuarter = kEnvironments / 4;
  for (std::size_t part = 0; part < 4; ++part) {
    double mean = 0;
    for (std::size_t i = 0; i < kQuarter; ++i)
      mean += by_offset[part * kQuarter + i].second / kQuarter;
    EXPECT_GT(mean, before) << "quarter " << part;
    before = mean;
  }
}

/// Fifty steps of 50 ms reach the same state as 500 steps of 5 ms, because an implicit step of any
/// length ends at rest.
TEST(StableGrasp, SettlesInFewerStepsToTheSameRest) {
  const auto task = task_named("stable_grasp");
  const auto all = starts(*task);
  const TaskSpec& spec = task->spec();
  for (std::size_t episode = 0; episode < 4; ++episode) {
    std::vector<std::vector<double>> rest;
    for (const bool coarse : {true, false}) {
      StepperOptions options;
      if (coarse) options.timestep = spec.settling_timestep;
      Stepper stepper(task->model(), options);
      Batch batch(task->model(), 1, 3, std::int64_t(episode));
      for (int b = 0; b < 11; ++b)
        batch.set_randomized_value(0, b, all[episode].varying[std::size_t(b)]);
      batch.set_state(0, all[episode].q, all[episode].v);
      std::vector<double> u(6), action{0.0};
      task->controls({3, std::int64_t(episode), 0, all[episode].memory, action, {}}, 0, u);
      for (int t = 0; t < (coarse ? spec.settling_steps : 500); ++t) stepper.step(batch, u);
      rest.emplace_back(std::size_t(task->model().nq()));
      batch.get_q(0, rest.back());
    }
    for (std::size_t i = 0; i < rest[0].size(); ++i)
      EXPECT_NEAR(rest[0][i], rest[1][i], 2e-5) << "coordinate " << i;
  }
}

TEST(Insertion, StartsFollowTheirDistributions) {
  const auto all = starts(*task_named("insertion"));
  const double degree = std::numbers::pi / 180;
  const std::pair<double, double> memory[] = {
      {-6e-3, 6e-3}, {-6e-3, 6e-3}, {-10 * degree, 10 * degree}};
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_LT(uniform_distance(column(all, [=](const Start& s) { return s.memory[3 + k]; }),
                               memory[k].first, memory[k].second),
              kUnlikely);
  EXPECT_LT(uniform_distance(column(all, [](const Start& s) { return s.memory[6]; }), -0.01, 5e-3),
            kUnlikely);
  EXPECT_LT(uniform_distance(column(all, [](const Start& s) { return s.memory[7]; }), 0.125, 0.8),
            kUnlikely);
  const std::pair<double, double> skin[] = {{2e3, 14e3}, {20, 140},  {0.5, 2.5}, {50, 450},
                                            {0.2, 2.3},  {0.5, 2.5}, {0, 100}};
  for (std::size_t k = 0; k < 7; ++k) {
    EXPECT_LT(uniform_distance(column(all, [=](const Start& s) { return s.varying[k]; }),
                               skin[k].first, skin[k].second),
              kUnlikely)
        << k;
    ASSERT_EQ(all[5].varying[k], all[5].varying[7 + k]) << "both pads are of one skin";
  }
  for (const char* name : {"insertion_rotation", "insertion_translation"}) {
    const Start one = starts(*task_named(name))[3];
    const bool rotation = std::string(name) == "insertion_rotation";
    EXPECT_EQ(one.memory[3] == 0 && one.memory[4] == 0, rotation);
    EXPECT_EQ(one.memory[5] == 0, !rotation);
  }
}

TEST(Insertion, WhatGoesInFeelsNoRim) {
  const auto task = task_named("insertion_translation");
  constexpr int kEnvironments = 48;
  VectorTask vector(*task, kEnvironments);
  for (int e = 0; e < kEnvironments; ++e) {
    const auto off = vector.view(e).task_state.subspan(3, 2);
    const bool fits = std::abs(off[0]) < 2e-3 && std::abs(off[1]) < 2e-3;
    const Snapshot now = vector.view(e).now();
    const bool inside = task->evaluate({0,
                                        0,
                                        1,
                                        vector.view(e).task_state,
                                        vector.actions().subspan(2 * std::size_t(e), 2),
                                        {&now, 1}})
                            .success;
    EXPECT_TRUE(inside || !fits) << off[0] << " " << off[1];
    if (std::abs(off[0]) > 3e-3 || std::abs(off[1]) > 3e-3) {
      EXPECT_FALSE(inside) << off[0] << " " << off[1];
    }
  }
}

TEST(Policy, RandomKeepsTheBoundsAndATableItsRows) {
  const auto task = task_named("dummy");
  VectorTask vector(*task, 40);
  std::vector<double> actions(40);
  Policy(*task, PolicyKind::random).act(vector, actions);
  const auto [low, high] = std::minmax_element(actions.begin(), actions.end());
  EXPECT_GE(*low, -0.5);
  EXPECT_LE(*high, 0.5);
  EXPECT_GT(*high - *low, 0.8);
  const Policy table(*task, PolicyKind::csv, {{0.1}, {0.2}});
  for (const double expected : {0.1, 0.2, 0.2}) {
    table.act(vector, actions);
    EXPECT_THAT(actions, ::testing::Each(expected));
    vector.step(actions);
  }
  EXPECT_THROW(Policy(*task, PolicyKind::csv, {}), InputError);
  EXPECT_THROW(Policy(*task, PolicyKind::csv, {{0.1, 0.2}}), InputError);
}

}  // namespace
}  // namespace tangere
