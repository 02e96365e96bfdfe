// SPDX-License-Identifier: Apache-2.0
// Tests energies and momenta against closed forms and invariants, and criteria against motions that
// are known.
#include "tasks/stress/criteria.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::DoubleNear;

Scene scene_of(const std::string& inside, const std::string& gravity = "0 0 0") {
  return parse_scene("<tangere model=\"test\"><option unit=\"m-kg\" gravity=\"" + gravity +
                         "\" timestep=\"1e-3\" integrator=\"SDIRK3\"/>" + inside + "</tangere>",
                     "test.xml")
      .scene;
}
std::string free_body(const std::string& body, const std::string& v) {
  return "<robot><link name=\"b\"><joint name=\"b\" type=\"free3d\"/>" + body +
         "</link></robot><initial><joint name=\"b\" v=\"" + v + "\"/></initial>";
}

StressHistory played(const Scene& scene, int steps) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model);
  Readout readout(model);
  StressHistory history(model, stepper.timestep());
  history.add(readout, batch, 0);
  for (int k = 0; k < steps; ++k) {
    stepper.step(batch, {});
    history.add(readout, batch, 0);
  }
  return history;
}

/// A wrong inertia would not be that with which the engine turns the body, so neither energy nor
/// momentum would stay.
class StressHistoryOf : public ::testing::TestWithParam<const char*> {};
TEST_P(StressHistoryOf, ATumblingBodyKeepsEnergyAndMomentum) {
  const StressHistory history = played(scene_of(free_body(GetParam(), "1 2 3 9 20 5")), 300);
  EXPECT_LT(energy_change(history), 1e-5);
  EXPECT_LT(momentum_change(history), 1e-5);
  EXPECT_GT(std::abs(history.spin(300, 0)[0] - history.spin(0, 0)[0]), 0.1);
}
INSTANTIATE_TEST_SUITE_P(
    Shapes, StressHistoryOf,
    ::testing::Values(R"(<body type="cuboid" size="0.1 0.06 0.02" density="1000"/>)",
                      R"(<body type="ellipsoid" size="0.1 0.06 0.02" density="1000"/>)",
                      R"(<body type="cylinder" length="0.1" radius="0.02" density="1000"/>)",
                      R"(<body type="capsule" length="0.05" radius="0.02" density="1000"/>)",
                      R"(<body type="abstract" mass="1" inertia="2e-3 1e-4 0 3e-3 1e-4 4e-3"/>)"));

TEST(StressHistory, HasTheEnergyOfABall) {
  const std::string ball = R"(<body type="sphere" radius="0.1" density="1000"/>)";
  const StressHistory history = played(scene_of(free_body(ball, "1 2 2 0 0 7"), "0 0 -10"), 1);
  const double mass = 1000 * 4.0 / 3 * M_PI * 1e-3, inertia = 0.4 * mass * 0.01;
  EXPECT_THAT(history.kinetic_energy(0), DoubleNear(mass * 4.5 + inertia * 24.5, 1e-12));
  EXPECT_THAT(history.height_energy(0), DoubleNear(0, 1e-12));
  EXPECT_THAT(history.angular_momentum(0)[2], DoubleNear(inertia * 7, 1e-12));
  EXPECT_THAT(history.height_energy(1), DoubleNear(mass * 10 * history.position(1, 0)[2], 1e-12));
}

TEST(Criteria, CountEnergyFromTheLowestPlaceOfTheRun) {
  const std::string ball = R"(<body type="sphere" radius="0.1" density="1000"/>)";
  const StressHistory falling = played(scene_of(free_body(ball, "0 0 0 0 0 0"), "0 0 -10"), 100);
  EXPECT_THAT(energy_ratio(falling), DoubleNear(1, 1e-9));
  EXPECT_THAT(largest_sink(falling), DoubleNear(0.05, 1e-6));
  EXPECT_THAT(largest_shift(falling), DoubleNear(0.05, 1e-6));
}

/// From 0.5 s on, and from the start where it falls farther than may be.
TEST(Criteria, TellCreepFromAFall) {
  const std::string ball = R"(<body type="sphere" radius="0.1" density="1000"/>)";
  const StressHistory slow = played(scene_of(free_body(ball, "0.03 0 0 0 0 0"), "0 0 0"), 200);
  EXPECT_THAT(creep_after(0.05, 1e-3)(slow), DoubleNear(0.03 * 0.15, 1e-9));
  EXPECT_THAT(creep_after(0, 1e-3)(slow), DoubleNear(0.03 * 0.2, 1e-9));
  const StressHistory falling = played(scene_of(free_body(ball, "0 0 0 0 0 0"), "0 0 -10"), 100);
  EXPECT_THAT(creep_after(0.09, 1e-3)(falling), DoubleNear(0.05, 1e-6));
  EXPECT_THAT(creep_after(0.09, 0.1)(falling), DoubleNear(0.05 - 0.0405, 1e-6));
}

TEST(Criteria, SeeWhatPassesAPlane) {
  const Scene scene = scene_of(
      R"(<ground pos="0 0 -0.02"/>)" + free_body(R"(<body name="b" type="sphere" radius="0.01"
                                                      density="1000"/>)",
                                                 "0 0 0 0 0 0"),
      "0 0 -10");
  EXPECT_THAT(sinks_below_ground(0)(played(scene, 100)), DoubleNear(0.03, 1e-6));
  EXPECT_THAT(sinks_below_ground(0)(played(scene, 1)), DoubleNear(-0.02, 1e-4));
}

TEST(Criteria, TellTurnsOfASpinningBall) {
  const std::string ball = R"(<body type="sphere" radius="0.1" density="1000"/>)";
  const StressHistory history = played(scene_of(free_body(ball, "0 0 0 0 0 100")), 77);
  EXPECT_LT(turn_error(0)(history), 1e-9);
}

}  // namespace
}  // namespace tangere
