// SPDX-License-Identifier: Apache-2.0
// Tests readings of a sensor whose pressure follows a table (docs/table.md).
#include "engine/sense/table_pressure.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using Numbers = std::vector<double>;

constexpr double kPressingRadius = 7.5e-3, kTablePitch = 1e-3;
const Numbers kTableDepth = {0, 0.5e-3, 1e-3, 3e-3}, kTablePressure = {0, 1e5, 1.1e5, 6e5};

/// A ball above the middle of 21 x 21 points at height 0.
Scene table_skin(double relaxation = 0) {
  Scene s;
  s.links = {testing::link("plate", JointType::fixed, {0, 0, -0.005},
                           CuboidShape{{0.03, 0.03, 0.01}, {2, 2, 2}}, 1000),
             testing::link("ball", JointType::translational, {0, 0, kPressingRadius},
                           SphereShape{kPressingRadius}, 1000)};
  TactileDescription t;
  t.name = "skin";
  t.body = "plate";
  t.array = {{-0.01, 0.01, 0.005}, {0.01, -0.01, 0.005}, {0, -1, 0}, {1, 0, 0}, 21, 21};
  t.table = PressureTable{kTableDepth, kTablePressure, 0, relaxation};
  t.coefficients.kn = t.table->stiffness() * kTablePitch * kTablePitch;
  s.sensors.push_back(t);
  s.gravity = {0, 0, 0};
  s.timestep = 1e-3;
  return s;
}

Numbers table_field(const Scene& scene, const Numbers& q, const Numbers& v = {0, 0, 0}) {
  const Model model(scene);
  Batch batch(model, 1, 0);
  batch.set_state(0, q, v);
  Numbers field(std::size_t(3 * model.sensors()[0].points));
  Readout(model).tactile(batch, 0, 0, field);
  return field;
}

/// Depth of the ball's underside at point k of the field [m].
double ball_depth_at(std::size_t k, double press) {
  const double x = 1e-3 * (double(k % 21) - 10), y = 1e-3 * (double(k / 21) - 10);
  const double square = kPressingRadius * kPressingRadius - x * x - y * y;
  return square > 0 ? press - kPressingRadius + std::sqrt(square) : -1;
}

TEST(TablePressure, EveryPointCarriesThePressureOfItsDepth) {
  const MonotoneCubic table(kTableDepth, kTablePressure);
  for (const double press : {0.3e-3, 0.9e-3, 2.5e-3, 4e-3}) {
    const Numbers field = table_field(table_skin(), {0, 0, -press});
    for (std::size_t k = 0; k < 441; ++k) {
      const double depth = ball_depth_at(k, press),
                   expected = depth > 0 ? 1e-6 * table.at(depth).value : 0;
      EXPECT_NEAR(field[3 * k + 2], expected, 1e-9 * (expected + 1e-3)) << k << " at " << press;
    }
  }
}

/// The pressure of a moving body is that of δ + τ δ̇.
TEST(TablePressure, RelaxationIsAddedDepth) {
  const MonotoneCubic table(kTableDepth, kTablePressure);
  const double tau = 0.01, rate = 0.02;
  const Numbers field = table_field(table_skin(tau), {0, 0, -0.6e-3}, {0, 0, -rate});
  EXPECT_NEAR(field[3 * 220 + 2], 1e-6 * table.at(0.6e-3 + tau * rate).value, 1e-12);
}

TEST(TablePressure, KnScalesTheTable) {
  Scene stiff = table_skin();
  stiff.sensors[0].coefficients.kn *= 2;
  stiff.randomizations.push_back(
      {{NumberOwner::tactile, NumberField::kn, "skin"},
       {Distribution::Kind::list, 0, 0, {3 * table_skin().sensors[0].coefficients.kn}},
       {}});
  const Numbers once = table_field(table_skin(), {0, 0, -1e-3}),
                drawn = table_field(stiff, {0, 0, -1e-3});
  stiff.randomizations.clear();
  // The file's own kn has the table as it is: it is what the springs of friction have.
  const Numbers same = table_field(stiff, {0, 0, -1e-3});
  for (std::size_t k = 0; k < once.size(); ++k) {
    EXPECT_NEAR(drawn[k], 1.5 * once[k], 1e-12);
    EXPECT_NEAR(same[k], once[k], 1e-12);
  }
}

/// A press that is then sheared: friction is that of the springs, in proportion to the load.
TEST(TablePressure, ASlideHasTheFrictionOfItsLoad) {
  Scene s = table_skin();
  ContactCoefficients& c = s.sensors[0].coefficients;
  c.mu = 0.5, c.ks = c.kn;
  MotorDescription motor;
  motor.joint = "ball_joint";
  motor.control = MotorControl::position;
  motor.low = -HUGE_VAL, motor.high = HUGE_VAL, motor.P = 1e9;
  s.motors.push_back(motor);
  const Model model(s);
  Batch batch(model, 1, 0);
  Stepper stepper(model);
  Numbers field(3 * 441), smooth = table_field(table_skin(), {5e-3, 0, -1e-3});
  batch.set_state(0, Numbers{0, 0, 1e-3}, Numbers{0, 0, 0});
  for (int k = 0; k <= 50; ++k) stepper.step(batch, Numbers{1e-4 * k, 0, -1e-3});
  Readout(model).tactile(batch, 0, 0, field);
  double normal = 0, shear = 0;
  for (std::size_t k = 0; k < field.size(); k += 3) {
    normal += smooth[k + 2];
    shear += field[k + 1] - smooth[k + 1];
    EXPECT_LE(std::hypot(field[k] - smooth[k], field[k + 1] - smooth[k + 1]),
              0.5 * smooth[k + 2] + 1e-12);
  }
  EXPECT_NEAR(std::abs(shear) / normal, 0.5, 0.05);
}

std::string table_fault_of(const Scene& s) {
  try {
    const Model model(s);
    return "";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(TablePressure, WhatItCannotBeIsRefused) {
  const auto fault = [](const auto& change) {
    Scene s = table_skin();
    change(s.sensors[0]);
    return table_fault_of(s);
  };
  EXPECT_EQ(fault([](auto&) {}), "");
  EXPECT_THAT(fault([](auto& d) { d.table->pressure[2] = 0.5e5; }),
              HasSubstr("expected pressures that do not fall"));
  EXPECT_THAT(fault([](auto& d) { d.table->depth[2] = 0.5e-3; }), HasSubstr("ascending depths"));
  EXPECT_THAT(fault([](auto& d) { d.table->pressure[0] = 1; }), HasSubstr("expected 0 at 0"));
  EXPECT_THAT(fault([](auto& d) { d.table->pressure.pop_back(); }),
              HasSubstr("4 depths and 3 pressures"));
  EXPECT_THAT(fault([](auto& d) { d.table->pressure = Numbers(4, 0.0); }),
              HasSubstr("expected a positive pressure"));
  EXPECT_THAT(fault([](auto& d) { d.table->thickness = 2e-3; }), HasSubstr("a thickness of"));
  EXPECT_THAT(fault([](auto& d) { d.material.emplace(); }), HasSubstr("expected one of them"));
  EXPECT_THAT(fault([](auto& d) { d.imperfections.delay = 0.1; }),
              HasSubstr("pressure of 'skin': delay"));
  EXPECT_THAT(fault([](auto& d) { d.points = tactile_points(d); }),
              HasSubstr("expected a flat array"));
}

}  // namespace
}  // namespace tangere
