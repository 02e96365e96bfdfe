// SPDX-License-Identifier: Apache-2.0
// Tests position motors against known answers, at either timing, and varying numbers of joints and
// motors.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"
#include "engine/step/rotation_log.hpp"
#include "tests/engine/effect_properties.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

const CuboidShape kBox{{0.2, 0.1, 0.06}, {2, 2, 2}};

MotorDescription position_motor(const std::string& joint, double P, double D,
                                double reach = HUGE_VAL) {
  return {joint, -reach, reach, {}, MotorControl::position, P, D};
}

void run(const Model& model, Batch& batch, Integrator scheme, double timestep, int steps,
         const std::vector<double>& u) {
  Stepper stepper(model, testing::options(scheme, timestep));
  for (int k = 0; k < steps; ++k) testing::step_all(stepper, batch, u);
  EXPECT_EQ(batch.failed_count(), 0);
}

TEST(PositionMotor, HoldsItsTargetAgainstGravity) {
  Scene s;
  s.links = {link("arm", JointType::revolute, {0, 0, 0}, kBox, 500),
             link("car", JointType::prismatic, {0, 1, 0}, kBox, 500)};
  s.links[0].joint.axis0 = {0, -1, 0};  // positive angles lift
  s.links[0].body.pose.position = {0.1, 0, 0};
  s.links[1].joint.axis0 = {0, 0, 1};
  s.motors = {position_motor("arm_joint", 20, 0.5), position_motor("car_joint", 300, 20)};
  const Model model(s);
  EXPECT_EQ(model.u_units()[0], "rad");
  EXPECT_EQ(model.u_units()[1], "m");
  for (Integrator scheme : testing::all_integrators()) {
    Batch batch(model, 3);
    run(model, batch, scheme, 5e-3, 1500, {0.6, -0.1});
    const double m = model.mass(0), q = q_of(batch, 2)[0];
    EXPECT_NEAR(20 * (0.6 - q), m * 9.8 * 0.1 * std::cos(q), 1e-8) << to_string(scheme);
    EXPECT_NEAR(q_of(batch, 2)[1], -0.1 - m * 9.8 / 300, 1e-8) << to_string(scheme);
    EXPECT_NEAR(v_of(batch, 2)[0], 0, 1e-8);
  }
}

TEST(PositionMotor, TurnsABallJointToARotationVector) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("ball", JointType::spherical, {0, 0, 0}, kBox, 500)};
  s.motors = {position_motor("ball_joint", 2, 0.05)};
  const Model model(s);
  ASSERT_EQ(model.nu(), 3);
  Batch batch(model, 1);
  run(model, batch, Integrator::bdf2, 2e-3, 4000, {0.9, -1.1, 1.7});
  const std::vector<double> q = q_of(batch);
  const kernels::Vec3<double> x = rotation_log({q[0], q[1], q[2], q[3]});
  EXPECT_NEAR(x.x, 0.9, 1e-8);
  EXPECT_NEAR(x.y, -1.1, 1e-8);
  EXPECT_NEAR(x.z, 1.7, 1e-8);
}

/// One body on a vertical slide.
Scene lift(const MotorDescription& motor) {
  Scene s;
  s.links = {link("car", JointType::prismatic, {0, 0, 0}, kBox, 500)};
  s.motors = {motor};
  return s;
}

TEST(PositionMotor, IsClippedToItsRange) {
  const double weight = 0.6 * 9.8;
  const Model model(lift(position_motor("car_joint", 1e4, 0, weight / 2)));
  ASSERT_NEAR(model.mass(0), 0.6, 1e-15);
  Batch batch(model, 1);
  run(model, batch, Integrator::bdf2, 1e-2, 50, {1});
  EXPECT_NEAR(v_of(batch)[0], -0.5 * 9.8 * 0.5, 1e-9);  // half its weight is carried
}

TEST(PositionMotor, OneStepIsItsFormulaAtEitherTiming) {
  const double P = 40, D = 3, u = 0.3, v0 = 0.7, h = 0.02, g = 9.8;
  for (double range : {HUGE_VAL, 8.0}) {
    MotorDescription motor = position_motor("car_joint", P, D, range);
    Scene s = lift(motor);
    s.initial.push_back({"car_joint", {0.05}, {v0}, {}});
    const Model end(s);
    s.motors[0].timing = MotorTiming::start;
    const Model start(s);
    const double m = end.mass(0);
    Batch a(end, 1), b(start, 1);
    run(end, a, Integrator::bdf1, h, 1, {u});
    run(start, b, Integrator::bdf1, h, 1, {u});
    const double at_start = std::clamp(P * (u - 0.05) - D * v0, -range, range);
    EXPECT_NEAR(v_of(b)[0], v0 + h * (at_start / m - g), 1e-10) << "the published explicit law";
    // End: m (v - v0)/h = P (u - q0 - h v) - D v - m g, or the range where that is beyond it.
    const double free = (m * v0 / h + P * (u - 0.05) - m * g) / (m / h + P * h + D);
    const double wanted = P * (u - 0.05 - h * free) - D * free;
    const double v =
        std::abs(wanted) > range ? v0 + h * (std::copysign(range, wanted) / m - g) : free;
    EXPECT_NEAR(v_of(a)[0], v, 1e-10);
    if (range > 100) {
      EXPECT_GT(std::abs(v_of(a)[0] - v_of(b)[0]), 1e-2);
    }
  }
}

TEST(PositionMotor, TimedAtTheStartTurnsABallJointByItsFormula) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("ball", JointType::spherical, {0, 0, 0}, SphereShape{0.1}, 500)};
  s.motors = {position_motor("ball_joint", 0.4, 0.02, 0.3)};
  s.motors[0].timing = MotorTiming::start;
  s.initial.push_back({"ball_joint", {0.8, 0.6, 0, 0}, {0.3, -0.2, 0.5}, {}});
  const Model model(s);
  Batch batch(model, 1);
  run(model, batch, Integrator::bdf1, 1e-3, 1, {0.2, 0.9, -0.4});
  const kernels::Vec3<double> way =
      rotation_log(kernels::Quat<double>{0.8, -0.6, 0, 0} *
                   kernels::quaternion_exp(kernels::Vec3<double>{0.2, 0.9, -0.4}));
  const double error[3] = {way.x, way.y, way.z}, before[3] = {0.3, -0.2, 0.5};
  const double inertia = 0.4 * model.mass(0) * 0.01;
  for (std::size_t k = 0; k < 3; ++k) {
    const double torque = std::clamp(0.4 * error[k] - 0.02 * before[k], -0.3, 0.3);
    EXPECT_NEAR(v_of(batch)[k], before[k] + 1e-3 * torque / inertia,
                1e-10);  // a ball has no gyroscopic torque
  }
}

TEST(PositionMotor, ImplicitDampingIsStableWhereTheExplicitOneIsNot) {
  MotorDescription motor = position_motor("car_joint", 10, 200);  // h D/m = 6.7 > 2
  Scene s = lift(motor);
  s.initial.push_back({"car_joint", {}, {0.1}, {}});
  const Model end(s);
  s.motors[0].timing = MotorTiming::start;
  const Model start(s);
  Batch a(end, 1), b(start, 1);
  Stepper implicit(end, testing::options(Integrator::bdf1, 0.02)),
      explicit_one(start, testing::options(Integrator::bdf1, 0.02));
  for (int k = 0; k < 20; ++k) {
    implicit.step(a, std::vector<double>{0});
    explicit_one.step(b, std::vector<double>{0});
  }
  EXPECT_LT(std::abs(v_of(a)[0]), 0.1);
  EXPECT_GT(std::abs(v_of(b)[0]), 1e3);
}

TEST(PositionMotor, EveryEnvironmentHasItsOwnTarget) {
  const Model model(lift(position_motor("car_joint", 500, 60)));
  Batch batch(model, 19);
  Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3));
  std::vector<double> u;
  for (int e = 0; e < 19; ++e) u.push_back(0.01 * e);
  for (int k = 0; k < 1000; ++k) stepper.step(batch, u);
  for (int e = 0; e < 19; ++e)
    EXPECT_NEAR(q_of(batch, e)[0], 0.01 * e - model.mass(0) * 9.8 / 500, 1e-9);
}

/// The motion under the controls `u`, one for each dof.
std::vector<double> after_steps(const Scene& s, const std::vector<double>& u) {
  const Model model(s);
  Batch batch(model, 1);
  run(model, batch, Integrator::bdf2, 2e-3, 50, u);
  return q_of(batch);
}

/// scale, offset and u_range give the bits of the target that they stand for.
TEST(MappedMotors, ATargetIsScaledAndItsControlClipped) {
  Scene s;
  s.links = {link("arm", JointType::revolute, {0, 0, 0}, kBox, 500),
             link("ball", JointType::spherical, {1, 0, 0}, kBox, 500)};
  s.links[0].joint.axis0 = {0, 1, 0};
  for (const MotorTiming timing : {MotorTiming::end, MotorTiming::start}) {
    s.motors = {position_motor("arm_joint", 20, 0.5), position_motor("ball_joint", 2, 0.1)};
    for (MotorDescription& m : s.motors) m.timing = timing;
    Scene mapped = s;
    for (MotorDescription& m : mapped.motors)
      m.scale = -0.01, m.offset = 0.3, m.u_range = {-20, 100};
    const auto target = [](double u) { return -0.01 * u + 0.3; };
    EXPECT_EQ(after_steps(mapped, {7, -5, 90, 0}),
              after_steps(s, {target(7), target(-5), target(90), target(0)}));
    EXPECT_EQ(after_steps(mapped, {-80, 100, 1e9, -20}),
              after_steps(s, {target(-20), target(100), target(100), target(-20)}));
    EXPECT_EQ(Model(mapped).u_units()[0], "1");
    for (MotorDescription& m : mapped.motors) m.scale.reset();
    EXPECT_EQ(after_steps(mapped, {0.5, 0, 0, 200}), after_steps(s, {0.8, 0.3, 0.3, 100.3}));
    EXPECT_EQ(Model(mapped).u_units()[0], "rad");
  }
}

TEST(MappedMotors, AForceIsScaledAndClippedTwice) {
  Scene s = lift({"car_joint", -6, 100, {}});
  s.motors[0].scale = 2, s.motors[0].offset = -1, s.motors[0].u_range = {-4, 3};
  s.gravity = {0, 0, 0};
  const Model model(s);
  for (const auto& [u, force] : {std::pair{0.0, -1.0}, {2.0, 3.0}, {30.0, 5.0}, {-3.0, -6.0}}) {
    Batch batch(model, 1);
    run(model, batch, Integrator::bdf1, 0.01, 10, {u});
    EXPECT_NEAR(v_of(batch)[0], 0.1 * force / model.mass(0), 1e-12) << u;
  }
}

/// Force motors and a position motor of one joint act together, at either timing.
TEST(MappedMotors, MotorsOfAJointAddUp) {
  MotorDescription first{"car_joint", -4, 4, {}}, second = first,
                                                  third = position_motor("car_joint", 80, 6);
  second.name = "boost", second.scale = 3, second.offset = 1;
  third.name = "hold";
  for (const MotorTiming timing : {MotorTiming::end, MotorTiming::start}) {
    third.timing = timing;
    Scene s = lift(first), one = lift(third);
    s.motors = {first, third, second};
    const Model model(s);
    EXPECT_EQ(model.u_names()[1], "hold");
    EXPECT_EQ(model.u_names()[2], "boost");
    Batch batch(model, 1);
    run(model, batch, Integrator::bdf2, 2e-3, 50, {0.5, 0.1, -0.7});
    one.gravity[2] += (0.5 * 4 + 3 * -0.7 + 1) / model.mass(0);  // the same force
    EXPECT_NEAR(q_of(batch)[0], after_steps(one, {0.1})[0], 1e-12);
  }
}

/// A force motor with D: far from the wanted velocity it pushes with the bound, near it the
/// velocity approaches as exp(-D t/m), with any D.
TEST(Motors, AServoOfVelocityIsClippedAsAWhole) {
  Scene s = lift({"car_joint", -40, 40, {}});
  s.gravity = {0, 0, 0};
  MotorDescription& motor = s.motors[0];
  motor.D = 50;
  motor.scale = 50;  // u is the velocity
  const Model model(s);
  const double m = model.mass(0), h = 1e-3;
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(Integrator::sdirk3, h));
  int t = 0;
  for (; 50 * (2 - 40 * h * (t + 1) / m) > 40; ++t) stepper.step(batch, std::vector<double>{2});
  EXPECT_GT(t, 10);
  EXPECT_NEAR(v_of(batch)[0], 40 * h * t / m, 1e-9) << "with the bound";
  for (int k = 0; k < 3; ++k) stepper.step(batch, std::vector<double>{2});
  const double v = v_of(batch)[0];
  for (int k = 0; k < 100; ++k) stepper.step(batch, std::vector<double>{2});
  EXPECT_NEAR(v_of(batch)[0], 2 - (2 - v) * std::exp(-50 * 0.1 / m), 1e-6);
  s.motors[0].D = s.motors[0].scale.emplace(1e9);
  const Model stiff(s);
  Batch soon(stiff, 1);
  Stepper large(stiff, testing::options(Integrator::bdf1, 0.1));
  for (int k = 0; k < 100; ++k) large.step(soon, std::vector<double>{0.5});
  EXPECT_NEAR(v_of(soon)[0], 0.5, 1e-6);
}

TEST(Motors, FaultsOfServosSayWhatWasExpected) {
  const auto fault = [](const auto& change) {
    return testing::fault_of_model(lift({"car_joint", -1, 1, {}}), change);
  };
  EXPECT_NE(fault([](Scene& s) { s.motors[0].D = 2; }).find("needs 'scale'"), std::string::npos);
  EXPECT_NE(fault([](Scene& s) {
              s.motors[0].D = 2, s.motors[0].scale = 1;
              s.motors.push_back(position_motor("car_joint", 1, 1));
              s.motors.back().name = "other";
            }).find("or a force motor with D; expected one at most"),
            std::string::npos);
}

TEST(VariedJoints, ADrawnNumberActsLikeAConstantOne) {
  Scene s;
  s.links = {link("arm", JointType::revolute, {0, 0, 0}, kBox, 500),
             link("ball", JointType::spherical, {1, 0, 0}, kBox, 500)};
  s.links[0].joint.axis0 = {0, 1, 0};
  for (LinkDescription& l : s.links)
    l.body.pose.position = {0.1, 0, 0}, l.joint.limits = {-0.1, 0.05};
  s.motors = {position_motor("arm_joint", 1, 0.1), position_motor("ball_joint", 1, 0.1, 0.5)};
  for (MotorTiming timing : {MotorTiming::end, MotorTiming::start})
    for (NumberField field : {NumberField::damping, NumberField::armature, NumberField::stiffness,
                              NumberField::lim_stiffness, NumberField::P, NumberField::D}) {
      Scene varied = s;
      for (MotorDescription& motor : varied.motors) motor.timing = timing;
      const Scene fixed = varied;
      const NumberOwner owner = field == NumberField::P || field == NumberField::D
                                    ? NumberOwner::motor
                                    : NumberOwner::joint;
      for (const LinkDescription& l : s.links) {
        RandomizationDescription d;
        d.number = {owner, field, l.joint.name};
        d.distribution.a = 0.01, d.distribution.b = 0.4;
        varied.randomizations.push_back(d);
      }
      const Model model(varied);
      Batch batch(model, 11, 3);
      run(model, batch, Integrator::bdf2, 2e-3, 50, {0.3, 0.1, 0.2, 0.3});
      for (int e : {0, 4, 10}) {
        Scene own = fixed;
        for (std::size_t k = 0; k < 2; ++k) {
          const double x = batch.randomized_value(e, static_cast<int>(k));
          ASSERT_GT(x, 0.01);
          number_in(own, {owner, field, own.links[k].joint.name}) = x;
        }
        const Model constant(own);
        Batch alone(constant, 1);
        run(constant, alone, Integrator::bdf2, 2e-3, 50, {0.3, 0.1, 0.2, 0.3});
        EXPECT_EQ(q_of(batch, e), q_of(alone)) << number_kind(owner, field).name;
        EXPECT_EQ(v_of(batch, e), v_of(alone)) << number_kind(owner, field).name;
      }
      EXPECT_NE(q_of(batch, 0), q_of(batch, 4)) << number_kind(owner, field).name;
    }
}

TEST(VariedJoints, WhatIsNotThereCannotVary) {
  const auto fails = [](NumberOwner owner, NumberField field, JointType type) {
    Scene s = lift({"car_joint", -1, 1, {}});
    s.links.push_back(link("other", type, {1, 0, 0}, kBox, 500));
    RandomizationDescription d;
    d.number = {owner, field, type == JointType::fixed ? "other_joint" : "car_joint"};
    s.randomizations = {d};
    EXPECT_THROW(Model{s}, InputError) << static_cast<int>(field);
  };
  fails(NumberOwner::motor, NumberField::P, JointType::free);  // a force motor
  fails(NumberOwner::motor, NumberField::damping, JointType::free);
  fails(NumberOwner::joint, NumberField::P, JointType::free);
  fails(NumberOwner::joint, NumberField::lim_stiffness, JointType::free);  // no limits
  fails(NumberOwner::joint, NumberField::damping, JointType::fixed);
}

}  // namespace
}  // namespace tangere
