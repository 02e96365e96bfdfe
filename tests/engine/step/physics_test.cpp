// SPDX-License-Identifier: Apache-2.0
// Tests closed forms and invariants: free fall, tumbling, rest, rolling, signs of shear, uniform
// pressure, first touches.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

TEST(Physics, FreeFallIsAParabola) {
  Scene s;
  s.links = {link("ball", JointType::free, {0, 0, 1}, SphereShape{0.1}, 500)};
  s.initial.push_back({"ball_joint", {}, {0.3, 0, 1, 0, 5, 0}, {}});
  const Model model(s);
  for (Integrator scheme : {Integrator::bdf2, Integrator::sdirk2}) {
    Stepper stepper(model, testing::options(scheme, 0.01));
    Batch batch(model, 1);
    for (int k = 0; k < 50; ++k) stepper.step(batch, {});
    const double t = 0.5;
    EXPECT_NEAR(q_of(batch)[0], 0.3 * t, 1e-11);
    // BDF2 and SDIRK2 integrate constant acceleration exactly, except at the start.
    EXPECT_NEAR(q_of(batch)[2], 1 * t - 0.5 * 9.8 * t * t, 2e-4);
    EXPECT_NEAR(v_of(batch)[2], 1 - 9.8 * t, 1e-10);
    EXPECT_NEAR(v_of(batch)[4], 5, 1e-11);
  }
}

TEST(Physics, TumblingKeepsAngularMomentumToOrderTwo) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {
      link("body", JointType::free, {0, 0, 0}, CuboidShape{{0.3, 0.2, 0.1}, {2, 2, 2}}, 500)};
  s.initial.push_back({"body_joint", {}, {0, 0, 0, 0.05, 4, 0.05}, {}});  // about the middle axis
  const Model model(s);
  const double m = model.mass(0);
  const double inertia[3] = {m / 12 * (0.04 + 0.01), m / 12 * (0.09 + 0.01),
                             m / 12 * (0.09 + 0.04)};
  const auto drift = [&](Integrator scheme, int steps) {
    Stepper stepper(model, testing::options(scheme, 2.0 / steps));
    Batch batch(model, 1);
    const auto momentum = [&] {
      const std::vector<double> q = q_of(batch), v = v_of(batch);
      const kernels::Vec3<double> L =
          to_matrix(kernels::Quat<double>{q[3], q[4], q[5], q[6]}) *
          kernels::Vec3<double>{inertia[0] * v[3], inertia[1] * v[4], inertia[2] * v[5]};
      return L;
    };
    const kernels::Vec3<double> start = momentum();
    for (int k = 0; k < steps; ++k) stepper.step(batch, {});
    const kernels::Vec3<double> lost = momentum() - start;
    return std::sqrt(dot(lost, lost) / dot(start, start));
  };
  for (Integrator scheme : {Integrator::bdf2, Integrator::sdirk2}) {
    EXPECT_LT(drift(scheme, 2000), 1e-3);
    EXPECT_GT(drift(scheme, 500) / drift(scheme, 1000), 3.0);  // falls at least like h²
  }
}

TEST(Physics, SphereRestsWhereTheSpringCarriesIt) {
  Scene s;
  s.ground = GroundDescription{};
  s.links = {link("ball", JointType::free, {0, 0, 0.02}, SphereShape{0.02}, 1000)};
  s.ground_contacts.push_back({"ball", {500, 1, 0.5, 1}, ContactLaw::linear, 1e-5, {}});
  const Model model(s);
  Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3));
  Batch batch(model, 1);
  for (int k = 0; k < 2000; ++k) stepper.step(batch, {});
  const double depth = model.mass(0) * 9.8 / 500;
  EXPECT_NEAR(q_of(batch)[2], -depth, 1e-9 * depth + 1e-15);
}

TEST(Physics, BallRollsWithoutSlippingUnderAMovingPad) {
  // Viscous sticking needs a little creep. With a heavy pad and a light ball the contact speeds
  // agree up to that creep.
  Scene s = testing::rolling_ball(false, 8);
  const Model model(s);
  Stepper stepper(model);
  Batch batch(model, 1);
  for (int k = 0; k < 140; ++k) stepper.step(batch, testing::rolling_ball_control(k));
  ASSERT_EQ(batch.failed_count(), 0);
  const std::vector<double> v = v_of(batch), q = q_of(batch);
  const kernels::Vec3<double> omega = to_matrix(kernels::Quat<double>{q[6], q[7], q[8], q[9]}) *
                                      kernels::Vec3<double>{v[6], v[7], v[8]};
  EXPECT_GT(v[0], 0.05);
  const double r = 0.02;
  EXPECT_NEAR(v[3] + omega.y * r, v[0], 0.02 * v[0]);  // top of the ball moves with the pad
  EXPECT_NEAR(v[3] - omega.y * r, 0, 0.02 * v[0]);     // bottom stands on the ground
}

/// A pad is dragged over a fixed ball. The shear on the pad opposes the motion.
TEST(Physics, ShearOpposesSliding) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("pad", JointType::translational, {0, 0, 0.0245},
                  CuboidShape{{0.05, 0.05, 0.01}, {5, 5, 3}}, 1000),
             link("ball", JointType::fixed, {0, 0, 0}, SphereShape{0.02}, 1000)};
  TactileDescription t;
  t.name = "pad";
  t.body = "pad";
  t.coefficients = {1, 0.01, 2, 0};
  t.array = {{-0.025, 0.025, -0.005}, {0.025, -0.025, -0.005}, {0, -1, 0}, {1, 0, 0}, 21, 21};
  s.sensors.push_back(t);
  const Model model(s);
  EXPECT_EQ(model.sensors()[0].pressure_sign, -1);
  Readout readout(model);
  Batch batch(model, 1);
  std::vector<double> force(3 * 441);
  const struct { double vx, vy; } kMotions[] = {{0.1, 0}, {-0.1, 0}, {0, 0.1}, {0, -0.1}};
  for (const auto& motion : kMotions) {
    batch.set_state(0, std::vector<double>{0, 0, 0}, std::vector<double>{motion.vx, motion.vy, 0});
    readout.tactile(batch, 0, 0, force);
    double sum[3] = {0, 0, 0};
    for (std::size_t k = 0; k < force.size(); ++k) sum[k % 3] += force[k];
    EXPECT_LT(sum[2], 0) << "pressure reads negative: axis0 × axis1 points into the pad";
    // Force on the pad along x is Σ f·axis1, along y it is -Σ f·axis0.
    EXPECT_LT(sum[1] * motion.vx - sum[0] * motion.vy, 0);
    EXPECT_NEAR(sum[1] * motion.vy + sum[0] * motion.vx, 0, 1e-12 * std::abs(sum[2]));
  }
  batch.set_state(0, std::vector<double>{0, 0, 0.01}, std::vector<double>{0.1, 0, 0});
  readout.tactile(batch, 0, 0, force);
  for (double f : force) EXPECT_EQ(f, 0);  // out of contact: exactly zero
}

TEST(Physics, FlatOnFlatIsUniform) {
  Scene s;
  s.links = {
      link("pad", JointType::translational, {0, 0, 0.0295},
           CuboidShape{{0.03, 0.03, 0.01}, {3, 3, 3}}, 1000),
      link("block", JointType::fixed, {0, 0, 0}, CuboidShape{{0.1, 0.1, 0.05}, {3, 3, 3}}, 1000)};
  TactileDescription t;
  t.name = "pad";
  t.body = "pad";
  t.coefficients = {7, 0.1, 1, 0};
  t.array = {{-0.014, -0.014, -0.005}, {0.014, 0.014, -0.005}, {0, 1, 0}, {1, 0, 0}, 9, 11};
  t.array.axis0 = {1, 0, 0};
  t.array.axis1 = {0, 1, 0};
  s.sensors.push_back(t);
  const Model model(s);
  Readout readout(model);
  Batch batch(model, 1);
  std::vector<double> force(3 * 99);
  readout.tactile(batch, 0, 0, force);
  for (std::size_t k = 0; k < 99; ++k) {
    EXPECT_NEAR(std::abs(force[3 * k + 2]), 7 * 5e-4, 1e-9 * 7 * 5e-4);
    EXPECT_EQ(force[3 * k], 0);
    EXPECT_EQ(force[3 * k + 1], 0);
  }
}

TEST(Physics, FieldAndObjectMovingTogetherReadNoShear) {
  Scene s = testing::two_balls();
  s.links.pop_back();
  s.pair_contacts.pop_back();
  s.ground_contacts.clear();
  s.links[0].joint.type = JointType::free;
  s.motors.clear();
  const Model model(s);
  Readout readout(model);
  Batch batch(model, 1);
  // Both turn about the world's origin with ω and translate with v, so the pair moves rigidly.
  const kernels::Vec3<double> omega = {0.7, -1.1, 2}, shift = {0.2, 0.1, -0.3};
  std::vector<double> q(14, 0), v(12, 0);
  q[3] = q[10] = 1;
  q[2] = -0.009;  // pressed
  const Vector3 rest[2] = {s.links[0].joint.pose.position, s.links[1].joint.pose.position};
  for (std::size_t b = 0; b < 2; ++b) {
    const kernels::Vec3<double> at = {rest[b][0] + q[7 * b], rest[b][1] + q[7 * b + 1],
                                      rest[b][2] + q[7 * b + 2]};
    const kernels::Vec3<double> linear = shift + cross(omega, at);
    const double values[6] = {linear.x, linear.y, linear.z, omega.x, omega.y, omega.z};
    for (std::size_t i = 0; i < 6; ++i) v[6 * b + i] = values[i];
  }
  std::vector<double> moving(3 * 63), still(3 * 63);
  batch.set_state(0, q, v);
  readout.tactile(batch, 0, 0, moving);
  batch.set_state(0, q, std::vector<double>(12, 0));
  readout.tactile(batch, 0, 0, still);
  double peak = 0;
  for (double f : still) peak = std::max(peak, std::abs(f));
  ASSERT_GT(peak, 0);
  for (std::size_t k = 0; k < still.size(); ++k) EXPECT_NEAR(moving[k], still[k], 1e-10 * peak);
}

TEST(Physics, FirstTouchesOffCentreAllConverge) {
  const Model model(testing::rolling_ball(false, 8));
  Stepper stepper(model);
  Batch batch(model, 1024);
  for (int e = 0; e < 1024; ++e) {
    std::vector<double> q = q_of(batch, e);
    const int row = e / 32, col = e % 32;
    q[3] = 9e-3 * (col / 15.5 - 1);
    q[4] = 9e-3 * (row / 15.5 - 1);
    batch.set_state(e, q, v_of(batch, e));
  }
  int most = 0;
  for (int k = 0; k < 120; ++k) {
    testing::step_all(stepper, batch, testing::rolling_ball_control(k));
    for (int i : batch.iterations()) most = std::max(most, i);
  }
  EXPECT_EQ(batch.failed_count(), 0);
  EXPECT_LT(most, 200);
  Readout readout(model);
  std::vector<double> force(3 * 64);
  int touching = 0;
  for (int e = 0; e < 1024; ++e) touching += q_of(batch, e)[2] < -0.0149;
  EXPECT_EQ(touching, 1024);
}

TEST(Physics, StiffContactsConvergeOrSaySo) {
  for (double stiffness : {1e2, 1e4, 1e6}) {
    Scene s = testing::rolling_ball(false, 8);
    s.pair_contacts[0].coefficients.kn *= stiffness;
    s.ground_contacts[0].coefficients.kn *= stiffness;
    const Model model(s);
    Stepper stepper(model);
    Batch batch(model, 1);
    std::vector<double> last = q_of(batch);
    for (int k = 0; k < 350; ++k) {
      stepper.step(batch, testing::rolling_ball_control(k));
      if (failed(batch.status(0))) {
        EXPECT_EQ(q_of(batch), last);  // the last good state, never an unconverged one
        break;
      }
      last = q_of(batch);
    }
    for (double x : q_of(batch)) EXPECT_TRUE(std::isfinite(x));
    if (stiffness <= 1e2) {
      EXPECT_FALSE(failed(batch.status(0))) << "stiffness × " << stiffness;
    }
  }
}

TEST(Physics, TurningByPiInAStepIsAStatus) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("body", JointType::free, {0, 0, 0}, SphereShape{0.1}, 500)};
  s.initial.push_back({"body_joint", {}, {0, 0, 0, 0, 0, 700}, {}});
  const Model model(s);
  Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3));
  Batch batch(model, 1);
  const std::vector<double> before = q_of(batch);
  stepper.step(batch, {});
  EXPECT_EQ(batch.status(0), StepStatus::rotation);
  EXPECT_EQ(q_of(batch), before);
}

TEST(Physics, ShiftedSceneGivesTheSameMotion) {
  const auto run = [](double shift) {
    Scene s = testing::rolling_ball(false, 8);
    for (LinkDescription& l : s.links) l.joint.pose.position[0] += shift;
    s.ground->position[0] += shift;
    const Model model(s);
    Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3, 1e-10));
    Batch batch(model, 1);
    for (int k = 0; k < 200; ++k) stepper.step(batch, testing::rolling_ball_control(k));
    return q_of(batch);
  };
  const std::vector<double> near = run(0), far = run(1000);
  for (std::size_t i = 0; i < near.size(); ++i) EXPECT_NEAR(near[i], far[i], 1e-8);
}

}  // namespace
}  // namespace tangere
