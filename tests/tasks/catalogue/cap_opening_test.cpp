// SPDX-License-Identifier: Apache-2.0
// Tests cap opening: its draws, rewards, observations and actions. The tests of all tasks cover its
// derivatives and script.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

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

TEST(CapOpening, StartsFollowTheirDistributionsOutsideTheCap) {
  const auto task = task_named("cap_opening");
  const auto all = starts(*task);
  EXPECT_LT(
      uniform_distance(column(all, [](const Start& s) { return s.varying.at(0); }), 0.01, 0.7),
      kUnlikely);
  EXPECT_LT(
      uniform_distance(column(all, [](const Start& s) { return s.varying.at(1); }), 0.02, 0.08),
      kUnlikely);
  for (const std::size_t axis : {2U, 3U})
    EXPECT_LT(uniform_distance(column(all, [axis](const Start& s) { return s.varying.at(axis); }),
                               -0.02, 0.02),
              kUnlikely);
  EXPECT_EQ(all[0].varying.size(), 4U) << "damping, radius and place of the cap vary, nothing else";
  double mean = 0, square = 0;
  for (const Start& s : all) {
    ASSERT_EQ(s.q[0], 0) << "the cap";
    for (const std::size_t swing : {1U, 4U, 7U})
      mean += s.q[swing], square += s.q[swing] * s.q[swing];
    // Every tip stands clear of the cap: hips are 97 mm from the middle, links are 120 mm, a tip is
    // 12 mm.
    for (std::size_t f = 0; f < 3; ++f) {
      const double *q = &s.q[1 + 3 * f], turn = 2 * std::numbers::pi / 3 * double(f);
      const double out = 0.097 - 0.12 * std::sin(q[1]) - 0.12 * std::sin(q[1] + q[2]);
      const double left = 0.12 * (std::cos(q[1]) + std::cos(q[1] + q[2])) * std::sin(q[0]);
      const double x = std::cos(turn) * out - std::sin(turn) * left,
                   y = std::sin(turn) * out + std::cos(turn) * left;
      ASSERT_GT(std::hypot(x - s.varying[2], y - s.varying[3]), s.varying[1] + 0.013 - 1e-12);
    }
  }
  // Few draws are refused, and nearly as many swings to either side.
  EXPECT_NEAR(mean / (3 * kDraws), 0, 2.58 * 0.05 / std::sqrt(3 * kDraws));
  EXPECT_NEAR(std::sqrt(square / (3 * kDraws)), 0.05, 1e-3);
  VectorTask vector(*task, 64);
  const std::size_t observed = task->spec().observation_size();
  for (int e = 0; e < 64; ++e) {
    const auto o = vector.observation(e);
    EXPECT_THAT(std::vector<double>(o.begin() + 18, o.end()), ::testing::Each(0.0))
        << "a tip touches at the start";
    ASSERT_EQ(o.size(), observed);
  }
}

TEST(CapOpening, PaysWhatThePaperSays) {
  const auto task = task_named("cap_opening");
  OwnView own(*task);
  for (const std::size_t k : {0U, 3U}) own.action[k] = 0.5;
  own.tactile[0][3 * 302 + 7] = 0.01;  // the second finger touches
  own.q[0][0] = std::numbers::pi / 4 - 0.2;
  const double plain = -0.5 * 2 - 0.04 - 0.005 * 0.5;
  StepOutcome verdict = task->evaluate(own.view());
  EXPECT_NEAR(verdict.reward, plain, 1e-12);
  EXPECT_FALSE(verdict.terminated || verdict.success);
  own.end_effectors[0][8] = 0.051;  // the third fingertip is too high
  verdict = task->evaluate(own.view());
  EXPECT_NEAR(verdict.reward, plain - 50, 1e-12);
  EXPECT_TRUE(verdict.terminated);
  EXPECT_FALSE(verdict.success);
  own.end_effectors[0][8] = 0.049;
  own.q[0][0] = std::numbers::pi / 4 + 0.2;
  verdict = task->evaluate(own.view());
  EXPECT_NEAR(verdict.reward, plain + 0.04 + 50, 1e-12);
  EXPECT_TRUE(verdict.terminated && verdict.success);
}

TEST(CapOpening, TargetsFollowTheAnglesWithinTheirLimits) {
  const auto task = task_named("cap_opening_blind");
  OwnView own(*task);
  own.q[0] = {0.3, -0.44, -0.5, 0.8, 0, 1.99, 0, 0, 0, -1.99};
  own.action = {-1, 1, -0.5, 0, 1, 0, 0, 0, -1};
  std::vector<double> u(9), q(10), v(10), action(9);
  task->controls(own.view(), 0, u);
  const std::vector<double> expected{-0.45, -0.44, 0.77, 0, 2, 0, 0, 0, -2};
  for (std::size_t k = 0; k < u.size(); ++k) EXPECT_NEAR(u[k], expected[k], 1e-15) << k;
  const std::vector<SnapshotCotangent> to{{q, v, {}, {}}};
  task->controls_vjp(own.view(), 0, std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8, 9}, {to, action});
  EXPECT_THAT(q, ::testing::ElementsAre(0, 0, 2, 3, 4, 0, 6, 7, 8, 0))
      << "a target at its limit stays there";
  EXPECT_THAT(v, ::testing::Each(0.0));
}

TEST(CapOpening, RefusesFingersThatWouldStartInTheCap) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/cap_opening.xml").scene;
  for (LinkDescription& link : scene.links)
    if (link.joint.name == "mount_1") link.joint.pose.position[0] = 0.07;
  EXPECT_THROW(static_cast<void>(make_task("cap_opening", scene)), InputError);
}

/// Every point is one pixel, where the scene's layout puts it; pixels without one are zero.
TEST(CapOpening, ShowsFieldsAsImages) {
  const auto task = task_named("cap_opening");
  OwnView own(*task);
  for (std::size_t k = 0; k < own.tactile[0].size(); ++k) own.tactile[0][k] = double(k + 1);
  std::vector<double> o(task->spec().observation_size(), -1.0);
  task->observe(own.view(), o);
  std::size_t zeros = 0;
  for (std::size_t f = 0; f < 3; ++f) {
    const auto& points = task->model().scene().sensors[f].points;
    for (std::size_t p = 0; p < points.size(); ++p)
      for (std::size_t c = 0; c < 3; ++c)
        ASSERT_EQ(
            o[18 +
              ((f * 20 + std::size_t(points[p].pixel[0])) * 20 + std::size_t(points[p].pixel[1])) *
                  3 +
              c],
            double(3 * (302 * f + p) + c + 1));
    for (std::size_t k = 0; k < 1200; ++k) zeros += o[18 + 1200 * f + k] == 0;
  }
  EXPECT_EQ(zeros, 3 * 3 * (400 - 302U));
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/cap_opening.xml").scene;
  for (const std::array<int, 2> wrong :
       {std::array{-1, -1}, std::array{20, 0}, scene.sensors[1].points[7].pixel}) {
    Scene other = scene;
    other.sensors[1].points[8].pixel = wrong;
    EXPECT_THROW(static_cast<void>(make_task("cap_opening", other)), InputError);
  }
  scene.sensors[2].points.pop_back();
  EXPECT_THROW(static_cast<void>(make_task("cap_opening", scene)), InputError);
}

TEST(CapOpening, ObservesTouchOrNot) {
  const auto task = task_named("cap_opening"), blind = task_named("cap_opening_blind");
  EXPECT_EQ(blind->spec().observation_size(), 18U);
  EXPECT_EQ(task->spec().observation_size(), 18U + 3 * 20 * 20 * 3);
  VectorTask seeing(*task, 2), unseeing(*blind, 2);
  for (std::size_t k = 0; k < 18; ++k)
    EXPECT_EQ(seeing.observation(1)[k], unseeing.observation(1)[k]);
  // Every fingertip is where its angles put it: at that distance from the axis, and a third of a
  // turn from the next one.
  for (std::size_t f = 0; f < 3; ++f) {
    const auto o = seeing.observation(1);
    const double *q = &o[3 * f], *tip = &o[9 + 3 * f];
    const double turn = 2 * std::numbers::pi / 3 * double(f);
    const double out = 0.097 - 0.12 * std::sin(q[1]) - 0.12 * std::sin(q[1] + q[2]);
    EXPECT_NEAR(std::cos(turn) * tip[0] + std::sin(turn) * tip[1], out, 1e-6) << "finger " << f + 1;
  }
}

}  // namespace
}  // namespace tangere
