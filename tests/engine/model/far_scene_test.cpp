// SPDX-License-Identifier: Apache-2.0
// Tests that a scene far from the world's origin does what it does near it, and what is warned of
// before a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/model/short_touches.hpp"
#include "engine/sense/readout.hpp"
#include "engine/sense/start_overlaps.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::link;
using testing::q_of;
using testing::v_of;

Vector3 sum(const Vector3& a, const Vector3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

/// The same scene elsewhere.
Scene moved(Scene scene, const Vector3& by) {
  for (LinkDescription& l : scene.links)
    if (l.parent < 0) l.joint.pose.position = sum(l.joint.pose.position, by);
  if (scene.ground) scene.ground->position = sum(scene.ground->position, by);
  return scene;
}

/// The rolling ball beside a fixed block with an arm, both with end effectors.
Scene with_fixed_block() {
  Scene s = testing::rolling_ball(false, 24);
  s.links.push_back(
      link("block", JointType::fixed, {0.03, 0, 0.01}, CuboidShape{{0.01, 0.2, 0.03}}, 1000));
  s.links.push_back(link("arm", JointType::revolute, {0, 0, 0.05}, SphereShape{0.005}, 1000));
  s.links.back().parent = 2;
  s.links.back().joint.axis0 = {1, 0, 0};
  s.links.back().body.pose.position = {0, 0.01, 0};
  s.pair_contacts.push_back({"pad", "block", {5, 1, 1, 1}, ContactLaw::clamped, 1e-5, {}});
  for (const char* joint : {"block_joint", "arm_joint", "ball_joint"}) {
    EndEffectorDescription& tip = s.end_effectors.emplace_back();
    tip.name = tip.joint = joint;
    tip.position = {0.001, 0.002, 0.003};
  }
  return s;
}

struct Ended {
  std::vector<double> q, v, field, pose, place;
};
Ended run(const Scene& scene) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3, 1e-12));
  Readout readout(model);
  for (int t = 0; t < 130; ++t) testing::step_all(stepper, batch, testing::rolling_ball_control(t));
  EXPECT_FALSE(failed(batch.status(0)));
  Ended out{q_of(batch), v_of(batch), {}, {}, {}};
  out.field.resize(std::size_t(3 * model.sensors()[0].points));
  readout.tactile(batch, 0, 0, out.field);
  std::vector<double> twist(std::size_t(6 * model.nb()));
  out.pose.resize(std::size_t(7 * model.nb()));
  readout.bodies(batch, 0, out.pose, twist);
  out.place.resize(3 * model.end_effectors().size());
  readout.end_effectors(batch, 0, out.place);
  return out;
}

double worst(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0, largest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    most = std::max(most, std::abs(a[k] - b[k]));
    largest = std::max(largest, std::abs(a[k]));
  }
  return most / largest;
}

TEST(FarScene, DoesWhatItDoesNearTheOrigin) {
  const Vector3 by{1000, -700, 300};
  const Ended near = run(with_fixed_block()), far = run(moved(with_fixed_block(), by));
  EXPECT_EQ(worst(near.field, std::vector<double>(near.field.size())), 1) << "the pad touches";
  EXPECT_LE(worst(near.q, far.q), 1e-9);
  EXPECT_LE(worst(near.v, far.v), 1e-9);
  EXPECT_LE(worst(near.field, far.field), 1e-9);
  for (std::size_t b = 0; b < near.pose.size() / 7; ++b)
    for (std::size_t k = 0; k < 7; ++k)
      EXPECT_NEAR(far.pose[7 * b + k], near.pose[7 * b + k] + (k < 3 ? by[k] : 0), 1e-11)
          << b << " " << k;
  for (std::size_t k = 0; k < near.place.size(); ++k)
    EXPECT_NEAR(far.place[k], near.place[k] + by[k % 3], 1e-11) << k;
}

TEST(FarScene, PlacesThatVaryAreWhereTheyAreNear) {
  const auto drawn = [](const Vector3& by) {
    Scene s = moved(with_fixed_block(), by);
    RandomizationDescription place;
    place.number = {NumberOwner::joint, NumberField::pos, "ball_joint", 0};
    place.distribution = {Distribution::Kind::uniform, by[0] - 0.002, by[0] + 0.002, {}};
    s.randomizations.push_back(place);
    return run(s);
  };
  const Ended near = drawn({0, 0, 0}), far = drawn({1000, 0, 0});
  EXPECT_LE(worst(near.v, far.v), 1e-8);
  EXPECT_NEAR(far.pose[7], near.pose[7] + 1000, 1e-10);
}

TEST(FarScene, ScenesNearTheOriginStayWhereTheyAre) {
  EXPECT_FALSE(compiled(Model(testing::rolling_ball())).moved);
  EXPECT_FALSE(compiled(Model(testing::two_balls())).moved);
  EXPECT_TRUE(compiled(Model(moved(testing::two_balls(), {0, 0, 1000}))).moved);
}

/// Small bodies far from the origin, whose scenes are not: they hang on it, or fall to its ground.
TEST(FarScene, SmallBodiesDoNotMakeASceneFar) {
  AbstractShape point;
  point.mass = 0.1;
  point.inertia = {1e-9, 0, 0, 1e-9, 0, 1e-9};
  for (const Shape& bob : {Shape(SphereShape{0.0005}), Shape(point)}) {
    Scene pendulum;
    pendulum.links = {link("bob", JointType::revolute, {0, 0, 0}, bob, 1000)};
    pendulum.links[0].joint.axis0 = {0, 1, 0};
    pendulum.links[0].body.pose.position = {0, 0, -1};
    EXPECT_FALSE(compiled(Model(pendulum)).moved);
    EXPECT_GT(compiled(Model(pendulum)).fall_time, 0.3);
  }
  Scene falling;
  falling.ground = GroundDescription{};
  falling.links = {link("ball", JointType::free, {0, 0, 3}, SphereShape{0.0005}, 1000)};
  falling.ground_contacts.push_back({"ball", {1e4, 0, 0, 10}, ContactLaw::clamped, 1e-5, {}});
  EXPECT_FALSE(compiled(Model(falling)).moved);
}

TEST(FarScene, IsWarnedOfWherePositionsAreTooCoarse) {
  EXPECT_THAT(rounded_places(Model(moved(testing::two_balls(), {0, 0, 1000}))), IsEmpty());
  const auto lines = rounded_places(Model(moved(testing::two_balls(), {1e7, 0, 0})));
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_THAT(lines[0], HasSubstr("'plate' starts 1e+07 m away, where positions are rounded to"));
}

/// A ball of 10 g on a spring of 10 kN/m: a touch lasts 3.1 ms.
Scene springy(double damping) {
  Scene s;
  s.ground = GroundDescription{};
  s.links = {link("ball", JointType::free, {0, 0, 0.02}, SphereShape{0.01}, 2387.3241)};
  s.ground_contacts.push_back({"ball", {1e4, 0, 0, damping}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

TEST(ShortTouches, AreWarnedOfWhereNothingDampsThem) {
  const auto lines = short_touches(Model(springy(0)), Integrator::sdirk2, 1e-3);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_THAT(lines[0],
              HasSubstr("'ball' with 'ground' has no damping, and a touch lasts 0.0031 s"));
  EXPECT_THAT(lines[0], HasSubstr("steps of 0.00016 s at most with SDIRK2"));
  EXPECT_THAT(short_touches(Model(springy(0)), Integrator::sdirk2, 1.5e-4), IsEmpty());
  EXPECT_EQ(short_touches(Model(springy(0)), Integrator::bdf1, 1.5e-4).size(), 1U);
  EXPECT_THAT(short_touches(Model(springy(100)), Integrator::bdf1, 5e-3), IsEmpty());
  EXPECT_THAT(short_touches(Model(testing::rolling_ball()), Integrator::bdf1, 5e-3), IsEmpty());
}

}  // namespace
}  // namespace tangere
