// SPDX-License-Identifier: Apache-2.0
// Tests what a step says of bodies that overlap between their contact points, or that come through
// each other slowly.
#include "engine/step/interpenetration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/model/model.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;

constexpr double kDown[] = {0, 0, -1};

/// A body fixed in the world, and one that moves along z above it. Both touch the other with their
/// contact points.
Scene one_above_another(const Shape& low, const Shape& high, double height, double kn) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("low", JointType::fixed, {0, 0, 0}, low, 1000),
             link("high", JointType::translational, {0, 0, height}, high, 1000)};
  for (const bool turned : {false, true})
    s.pair_contacts.push_back({turned ? "low" : "high",
                               turned ? "high" : "low",
                               {kn, 1, 0.5, 10},
                               ContactLaw::clamped,
                               1e-5,
                               {}});
  return s;
}

CuboidShape plank(const Vector3& size) { return {size, {2, 2, 2}}; }
const CuboidShape kAlongX = plank({0.4, 0.02, 0.01}), kAlongY = plank({0.02, 0.4, 0.01});

StepStatus status_at(Scene scene, double height) {
  scene.links[1].joint.pose.position[2] = height;
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(Integrator::bdf1, 1e-4));
  stepper.step(batch, {});
  return batch.status(0);
}

/// The largest ball in the overlap of two plates that overlap by e has the radius e/2. It counts
/// from a quarter of 5 mm on.
TEST(Interpenetration, CountsOverlapsOfAQuarterOfTheThickness) {
  const Scene planks = one_above_another(kAlongX, kAlongY, 0, 1000);
  EXPECT_EQ(status_at(planks, 0.01 - 0.0024), StepStatus::converged);
  EXPECT_EQ(status_at(planks, 0.01 - 0.0026), StepStatus::overlapping);
  EXPECT_EQ(status_at(planks, -(0.01 - 0.0026)), StepStatus::overlapping);
  EXPECT_EQ(status_at(planks, -(0.01 - 0.0024)), StepStatus::converged);
}

/// Rods whose axes cross at a distance D overlap in a ball of the radius r - D/2.
TEST(Interpenetration, MeasuresTheOverlapOfRoundBodies) {
  constexpr double kRadius = 0.01;
  Scene rods = one_above_another(CylinderShape{0.4, kRadius}, CylinderShape{0.3, kRadius}, 0, 1000);
  const double half = std::sqrt(0.5);
  rods.links[0].body.pose.orientation = {half, half, 0, 0};  // z of the body along -y
  rods.links[1].body.pose.orientation = {half, 0, half, 0};  // along x
  EXPECT_EQ(status_at(rods, 1.52 * kRadius), StepStatus::converged);
  EXPECT_EQ(status_at(rods, 1.48 * kRadius), StepStatus::overlapping);
}

/// Where points are inside the other body as deep as it overlaps, contact is resolved: a heavy
/// plate that lies on soft points says nothing.
TEST(Interpenetration, LeavesDeepContactsAlone) {
  CuboidShape fine = kAlongY;
  fine.contact_resolution = {5, 81, 3};
  EXPECT_EQ(status_at(one_above_another(kAlongX, fine, 0, 1), 0.006), StepStatus::converged);
  // Corners of the upper body are in the lower one, whose own are nowhere near.
  const Scene wide = one_above_another(plank({0.4, 0.4, 0.01}), plank({0.1, 0.1, 0.01}), 0, 1);
  EXPECT_EQ(status_at(wide, 0.006), StepStatus::converged);
}

struct Fall {
  int overlapping = 0, passed = 0, others = 0;
};
/// Lets the upper body come down at a speed [m/s].
Fall fall(const Scene& scene, double speed, double h, int steps) {
  const Model model(scene);
  Batch batch(model, 1);
  std::vector<double> v(3);
  for (std::size_t k = 0; k < 3; ++k) v[k] = speed * kDown[k];
  batch.set_state(0, q_of(batch), v);
  Stepper stepper(model, testing::options(Integrator::bdf1, h));
  Fall f;
  for (int t = 0; t < steps; ++t) {
    stepper.step(batch, {});
    f.overlapping += batch.status(0) == StepStatus::overlapping;
    f.passed += batch.status(0) == StepStatus::tunnelled;
    f.others += failed(batch.status(0));
  }
  return f;
}

TEST(Interpenetration, SlowBodiesThatComeThroughAreTold) {
  for (const double speed : {0.05, 0.3, 1.0}) {
    const Fall planks = fall(one_above_another(kAlongX, kAlongY, 0.02, 1000), speed, 1e-3,
                             int(0.04 / speed / 1e-3));
    EXPECT_GE(planks.overlapping, 2) << speed << " m/s";
    EXPECT_EQ(planks.passed, 1) << speed << " m/s";
  }
  // A rod has points at its ends alone, and a plate beside its middle that is narrower than it.
  Scene rod =
      one_above_another(CuboidShape{{0.02, 0.02, 0.01}}, CylinderShape{0.2, 0.01}, 0.03, 1000);
  rod.pair_contacts.pop_back();
  rod.links[1].body.pose.orientation = {std::sqrt(0.5), 0, std::sqrt(0.5), 0};
  const Fall rods = fall(rod, 0.2, 1e-3, 300);
  EXPECT_GE(rods.overlapping, 2);
  EXPECT_EQ(rods.passed, 1);
}

/// All points of the box push and damp, but not enough. Whether the step is split or not, the box
/// ends on the other side.
TEST(Interpenetration, BodiesThatCrossASoftPlateAreTold) {
  const Scene soft = one_above_another(plank({0.2, 0.2, 0.01}),
                                       CuboidShape{{0.04, 0.04, 0.04}, {6, 6, 6}}, 0.04, 20);
  for (const double speed : {2.0, 3.0, 10.0})
    for (const double h : {1e-3, 5e-3})
      EXPECT_GE(fall(soft, speed, h, int(0.1 / speed / h) + 2).passed, 1)
          << speed << " m/s, " << h << " s";
}

/// Whichever way a body comes through another, along its thinnest axis or not, through its middle
/// or beside it, in one step or in many.
TEST(Interpenetration, BodiesThatCrossACubeAreTold) {
  for (const double speed : {2.0, 100.0})
    for (const int axis : {0, 1, 2})
      for (const double beside : {0.0, 0.01})
        for (const bool ball : {false, true}) {
          Scene s;
          s.gravity = {0, 0, 0};
          Vector3 start{};
          start[std::size_t(axis)] = 0.06;
          start[std::size_t((axis + 1) % 3)] = start[std::size_t((axis + 2) % 3)] = beside;
          s.links = {link("cube", JointType::fixed, {0, 0, 0}, plank({0.04, 0.04, 0.04}), 1000),
                     link("small", JointType::translational, start,
                          ball ? Shape(SphereShape{0.01})
                               : Shape(CuboidShape{{0.02, 0.02, 0.02}, {6, 6, 6}}),
                          1000)};
          s.pair_contacts.push_back({"small", "cube", {1, 0, 0, 0}, ContactLaw::clamped, {}, {}});
          const Model model(s);
          Batch batch(model, 1);
          std::vector<double> v(3);
          v[std::size_t(axis)] = -speed;
          batch.set_state(0, q_of(batch), v);
          Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3));
          int passed = 0;
          for (int t = 0; t < int(0.1 / speed / 5e-3) + 3; ++t) {
            stepper.step(batch, {});
            passed += batch.status(0) == StepStatus::tunnelled;
          }
          EXPECT_GE(passed, 1) << speed << " m/s along " << axis << ", " << beside << " m, "
                               << ball;
        }
}

/// A ball that goes through a wide wall near its edge, and one that goes past it.
TEST(Interpenetration, TheEdgeOfAWallIsAThicknessWide) {
  for (const auto& [beside, status] :
       {std::pair{0.47, StepStatus::tunnelled}, {0.52, StepStatus::converged}}) {
    Scene s;
    s.gravity = {0, 0, 0};
    s.links = {link("wall", JointType::fixed, {0, 0, 0}, plank({1, 1, 0.02}), 1000),
               link("ball", JointType::translational, {0, beside, 0.2}, SphereShape{0.015}, 1000)};
    s.pair_contacts.push_back({"ball", "wall", {1, 0, 0, 0}, ContactLaw::clamped, {}, {}});
    const Model model(s);
    Batch batch(model, 1);
    batch.set_state(0, q_of(batch), std::vector<double>{0, 0, -100});
    Stepper stepper(model, testing::options(Integrator::bdf1, 5e-3));
    stepper.step(batch, {});
    EXPECT_EQ(batch.status(0), status) << beside << " m";
  }
}

/// A plate that falls on its edge between points that it would lie on when flat, and a ball on a
/// table of eight corners that is thinner than a sixteenth of its length.
TEST(Interpenetration, ThinBodiesAreTold) {
  Scene knife = one_above_another(CuboidShape{{0.1, 0.1, 0.1}, {3, 3, 3}}, plank({0.002, 0.1, 0.1}),
                                  0.11, 1000);
  knife.links[1].joint.pose.position[0] = 0.012;
  EXPECT_GE(fall(knife, 0.5, 1e-3, 250).overlapping, 2);
  MeshShape table;
  for (int k = 0; k < 8; ++k)
    for (int c = 0; c < 3; ++c)
      table.vertices.push_back((k >> c & 1 ? 1 : -1) * (c == 2 ? 0.003 : 0.1));
  table.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                     {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  Scene ball = one_above_another(table, SphereShape{0.02}, 0.03, 1000);
  ball.pair_contacts.erase(ball.pair_contacts.begin());  // a ball cannot touch a mesh
  EXPECT_GE(fall(ball, 0.5, 1e-3, 100).overlapping, 2);
}

/// Contacts that never push miss nothing.
TEST(Interpenetration, ContactsThatNeverPushAreNotChecked) {
  Scene planks = one_above_another(kAlongX, kAlongY, 0, 1000);
  for (PairContactDescription& c : planks.pair_contacts) c.coefficients = {};
  EXPECT_EQ(status_at(planks, 0.002), StepStatus::converged);
}

/// Sizes are those of the environment: beside a rod of a quarter of the scene's radius, a ball may
/// pass where the thick one would be.
TEST(Interpenetration, SizesThatVaryCount) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("rod", JointType::fixed, {0, 0, 0}, CylinderShape{0.2, 0.04}, 1000),
             link("ball", JointType::translational, {0.02, 0.05, 0}, SphereShape{0.005}, 1000)};
  s.pair_contacts.push_back({"ball", "rod", {1, 0, 0, 0}, ContactLaw::clamped, {}, {}});
  s.randomizations.push_back({{NumberOwner::body, NumberField::radius, "rod"},
                              {Distribution::Kind::list, 0, 0, {0.01}},
                              {}});
  const Model model(s);
  Batch batch(model, 1);
  batch.set_state(0, q_of(batch), std::vector<double>{0, -1, 0});
  Stepper stepper(model, testing::options(Integrator::bdf1, 1e-3));
  for (int t = 0; t < 100; ++t) {
    stepper.step(batch, {});
    ASSERT_EQ(batch.status(0), StepStatus::converged) << t;
  }
  EXPECT_LT(q_of(batch)[1], -0.09);
}

/// An arm that is six times as long as in the scene sweeps through a post with its end, which moves
/// farther than arms of the scene's size would.
TEST(Interpenetration, MotionsAreThoseOfSizesThatVary) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("arm", JointType::revolute, {0, 0, 0}, plank({0.1, 0.01, 0.01}), 1000),
             link("post", JointType::fixed, {0.2, 0.1, 0}, plank({0.02, 0.02, 0.2}), 1000)};
  s.links[0].joint.axis0 = {0, 0, 1};
  s.pair_contacts.push_back({"post", "arm", {1, 0, 0, 0}, ContactLaw::clamped, {}, {}});
  s.randomizations.push_back(
      {{NumberOwner::body, NumberField::size, "arm"}, {Distribution::Kind::list, 0, 0, {0.6}}, {}});
  const Model model(s);
  const auto play = [&](bool always) {
    Batch batch(model, 1);
    batch.set_state(0, q_of(batch), std::vector<double>{2});
    Stepper stepper(model, testing::options(Integrator::bdf1, 2e-3));
    std::vector<StepStatus> statuses;
    for (int t = 0; t < 300; ++t) {
      if (always) batch.restore_block(0, batch.save_block(0));
      stepper.step(batch, {});
      statuses.push_back(batch.status(0));
    }
    return statuses;
  };
  const std::vector<StepStatus> checked = play(true);
  EXPECT_EQ(play(false), checked);
  EXPECT_GE(std::ranges::count_if(
                checked, [](StepStatus status) { return status != StepStatus::converged; }),
            1);
}

/// What bodies have moved since the last check decides whether there is one. The statuses are those
/// of checks after every step: restoring a block makes the next one due.
TEST(Interpenetration, NoStepIsLeftOutThatACheckWouldTell) {
  Scene scene = one_above_another(kAlongX, kAlongY, 0.03, 1000);
  scene.links[1].joint.type = JointType::free;
  scene.links.push_back(
      link("arm", JointType::revolute, {0, 0, 0}, plank({0.02, 0.02, 0.3}), 1000));
  scene.links.back().parent = 1;
  scene.links.back().joint.axis0 = {1, 0, 0};
  scene.pair_contacts.push_back({"arm", "low", {100, 1, 0.5, 1}, ContactLaw::clamped, 1e-5, {}});
  const Model model(scene);
  int told = 0;
  const auto play = [&](bool always, int environments) {
    Batch batch(model, environments);
    for (int e = 0; e < environments; ++e) {
      std::vector<double> v(7, 0.0);
      v[0] = 0.2 * e, v[2] = -0.3 - 0.4 * e, v[3] = 1.0 * e, v[4] = 2 - e, v[6] = 3 - 2.0 * e;
      batch.set_state(e, q_of(batch, e), v);
    }
    Stepper stepper(model, testing::options(Integrator::bdf2, 2e-3));
    std::vector<StepStatus> statuses;
    for (int t = 0; t < 150; ++t) {
      if (always) batch.restore_block(0, batch.save_block(0));
      stepper.step(batch, {});
      for (int e = 0; e < environments; ++e) statuses.push_back(batch.status(e));
      told += int(std::ranges::count(batch.statuses(), StepStatus::overlapping) +
                  std::ranges::count(batch.statuses(), StepStatus::tunnelled));
    }
    return statuses;
  };
  EXPECT_EQ(play(false, 9), play(true, 9));
  EXPECT_EQ(play(false, 1), play(true, 1));
  EXPECT_GT(told, 20) << "the test has nothing to find";
}

}  // namespace
}  // namespace tangere
