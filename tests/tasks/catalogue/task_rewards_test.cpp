// SPDX-License-Identifier: Apache-2.0
// Tests rewards against numbers worked out by hand. Box pushing and cap opening have tests of their
// own.
#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <string>

#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using testing::OwnView;
using testing::task_named;

constexpr double kMillimetre = 1e-3, kDegree = std::numbers::pi / 180;

/// The first coordinate of a joint.
std::size_t place_of(const Task& task, const std::string& joint) {
  const auto& names = task.model().q_names();
  for (std::size_t i = 0; i < names.size(); ++i)
    if (names[i].starts_with(joint + ".")) return i;
  ADD_FAILURE() << "no joint " << joint;
  return 0;
}

void expect_pays(const Task& task, OwnView& own, double reward, bool solved, const char* what) {
  const StepOutcome verdict = task.evaluate(own.view());
  EXPECT_NEAR(verdict.reward, reward, 1e-12) << what;
  EXPECT_EQ(verdict.success, solved) << what;
}

TEST(Rewards, OfStableGrasp) {
  const auto task = task_named("stable_grasp");
  const std::size_t bar = place_of(*task, "bar");
  OwnView own(*task);
  own.memory[2] = 12 * kMillimetre;  // height at rest
  const auto hang =
      [&](double lifted,
          double tilt) {  // turned about x: the slope of the bar, along y, is the sine of it
        own.q[0][bar + 2] = (12 + lifted) * kMillimetre;
        own.q[0][bar + 3] = std::cos(tilt / 2);
        own.q[0][bar + 4] = std::sin(tilt / 2);
      };
  own.q[1][bar + 3] = 1;  // what follows the grasp, level and lowered, does not count
  struct Case {
    double lifted, tilt;  // [mm], [rad]
    double reward;
    bool solved;
  };
  const Case cases[] = {
      {30, 0.019, 100, true},    {30, -0.019, 100, true},     // below 0.02 rad to either side
      {30, 0.021, -0.21, false}, {30, -0.021, -0.21, false},  // 10 * 0.021
      {5.1, 0.01, 100, true},    {4.9, 0.01, -0.1, false},    // above 5 mm or not: 10 * 0.01
      {4.9, 0.5, -5, false},     {30, -1.2, -12, false},      // 10 * 0.5, 10 * 1.2
      {0, 0, 0, false},                                       // level, but not lifted
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.tilt);
    hang(c.lifted, c.tilt);
    expect_pays(*task, own, c.reward, c.solved, "a bar that hangs");
    EXPECT_EQ(task->evaluate(own.view()).terminated, c.solved);
  }
}

TEST(Rewards, OfInsertion) {
  const auto task = task_named("insertion");
  const std::size_t box = place_of(*task, "box");
  double rest_x = 0, rest_y = 0, rest = 0;
  for (const LinkDescription& link : task->model().scene().links)
    if (link.joint.name == "box") {
      rest_x = link.joint.pose.position[0];
      rest_y = link.joint.pose.position[1];
      rest = link.joint.pose.position[2];
    }
  OwnView own(*task);
  own.memory[0] = 1 * kMillimetre, own.memory[1] = -2 * kMillimetre, own.memory[2] = 3 * kDegree;
  own.action = {0.1, 0.05, 0.2};  // times 20 mm, 20 mm and 10 degrees: e = (1 + 2, -2 + 1, 3 + 2)
  // (3² + 1²)/6² + (5/10)² = 10/36 + 1/4 = 19/36
  const double outside = -19.0 / 36;
  const auto stand = [&](double height,
                         double tilt) {  // of the middle of its lower face, while it is level [mm]
    for (auto& q : own.q) {
      q[box + 2] = height * kMillimetre + 0.03 - rest;
      q[box + 3] = std::cos(tilt / 2);
      q[box + 4] = std::sin(tilt / 2);
    }
  };
  stand(30, 0);
  expect_pays(*task, own, outside, false, "on the rim");
  EXPECT_FALSE(task->evaluate(own.view()).terminated);
  stand(24.8, 0);
  expect_pays(*task, own, outside, false, "0.1 mm too high");
  stand(24.6, 0);
  expect_pays(*task, own, 10, true, "0.1 mm below 24.7 mm");
  EXPECT_TRUE(task->evaluate(own.view()).terminated);
  // Tilted by 0.01 rad a corner is 25 mm * 0.01 = 0.25 mm higher: at 24.85 and 24.65 mm.
  stand(24.6, 0.01);
  expect_pays(*task, own, outside, false, "inside with its middle, not with its corners");
  stand(24.4, -0.01);
  expect_pays(*task, own, 10, true, "tilted and inside");
  const double hole_x = 19.75, hole_y = 27.25;
  const auto place = [&](double x, double y) {  // of the box's middle [mm]
    for (auto& q : own.q) {
      q[box] = x * kMillimetre - rest_x;
      q[box + 1] = y * kMillimetre - rest_y;
    }
  };
  place(hole_x + 0.1, 0);
  expect_pays(*task, own, outside, false, "fallen beside a wall along x");
  place(0, -hole_y - 0.1);
  expect_pays(*task, own, outside, false, "fallen beside a wall along y");
  place(hole_x - 0.1, 0.1 - hole_y);
  expect_pays(*task, own, 10, true, "above the hole");
  // Yaw alone moves: 3 + 2 degrees; x and y stay where they are: (1² + 2²)/36 + 1/4 = 14/36.
  const auto turning = task_named("insertion_rotation");
  OwnView other(*turning);
  other.memory = own.memory;
  other.action = {0.2};
  for (auto& q : other.q) q[box + 2] = 0.06, q[box + 3] = 1;
  expect_pays(*turning, other, -14.0 / 36, false, "the yaw");
}

TEST(Rewards, OfBallRolling) {
  const auto task = task_named("ball_rolling_small");
  OwnView own(*task);
  const std::size_t ball = place_of(*task, "ball_joint");
  own.memory = {30 * kMillimetre, -10 * kMillimetre};  // the goal
  own.q[0][ball] = 25 * kMillimetre;
  own.q[0][ball + 1] = -22 * kMillimetre;
  own.action = {0.1, -0.2, 0.2};
  // 5 and 12 mm: 0.5² + 1.2² = 1.69; 0.01 (0.01 + 0.04 + 0.04) = 0.0009
  expect_pays(*task, own, -1.6909, false, "13 mm away");
  own.action = {0, 0, 0};
  own.q[0][ball] = 28.5 * kMillimetre;
  own.q[0][ball + 1] = -11 * kMillimetre;
  own.actions = 69;
  // 1.5 and 1 mm, 1.8 mm together: 0.15² + 0.1² = 0.0325
  expect_pays(*task, own, -0.0325, false, "there, but not at the end");
  own.actions = 70;
  expect_pays(*task, own, -0.0325, true, "there at the end");
  own.q[0][ball + 1] = -11.5 * kMillimetre;
  // 1.5 and 1.5 mm, 2.1 mm together: 2 * 0.15² = 0.045
  expect_pays(*task, own, -0.045, false, "too far at the end");
  EXPECT_FALSE(task->evaluate(own.view()).terminated);
}

TEST(Rewards, OfTheDummy) {
  const auto task = task_named("dummy");
  OwnView own(*task);
  own.memory = {20 * kMillimetre};
  own.q[0][2] = 13 * kMillimetre;
  own.action = {0.4};
  expect_pays(*task, own, -0.49, false, "7 mm below: (7/10)²");
  own.q[0][2] = 25 * kMillimetre;
  expect_pays(*task, own, -0.25, false, "5 mm above: (5/10)²");
  own.actions = 40;
  own.q[0][2] = 20.9 * kMillimetre;
  expect_pays(*task, own, -0.0081, true, "0.9 mm above: (0.9/10)²");
  own.q[0][2] = 18.9 * kMillimetre;
  expect_pays(*task, own, -0.0121, false, "1.1 mm below: (1.1/10)²");
  own.actions = 39;
  own.q[0][2] = 20 * kMillimetre;
  expect_pays(*task, own, 0, false, "at the goal before the end");
}

}  // namespace
}  // namespace tangere
