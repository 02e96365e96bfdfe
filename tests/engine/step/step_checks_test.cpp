// SPDX-License-Identifier: Apache-2.0
// Tests what is looked at after a step was solved: energy from nowhere, bodies that came through
// each other, and errors of light bodies beside heavy ones.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

/// A ball of 10 g above stiff ground, without gravity.
Scene impact(double kn) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.ground = GroundDescription{};
  s.links = {link("ball", JointType::free, {0, 0, 0.0123}, SphereShape{0.01}, 2387.3241)};
  s.ground_contacts.push_back({"ball", {kn, 1, 0.5, 0}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

/// The ball's energy of motion and what the ground holds, over that of the start; the worst.
struct Bounce {
  double energy = 1;
  int damped = 0;
};
Bounce bounce(const Scene& scene, Integrator scheme, double h, double speed) {
  const Model model(scene);
  Batch batch(model, 1);
  std::vector<double> v(std::size_t(model.nv()), 0.0);
  v[2] = -speed;
  batch.set_state(0, q_of(batch), v);
  Stepper stepper(model, testing::options(scheme, h));
  Bounce b;
  for (int t = 0; t < 60; ++t) {
    stepper.step(batch, {});
    EXPECT_FALSE(failed(batch.status(0)));
    b.damped += batch.status(0) == StepStatus::damped;
    v = v_of(batch);
    const double depth = std::min(q_of(batch)[2] + 0.0023, 0.0),
                 held = scene.ground_contacts[0].coefficients.kn * depth * depth / 0.01;
    b.energy =
        std::max(b.energy, (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + held) / (speed * speed));
  }
  return b;
}

TEST(BoundedEnergy, NoSchemeCreatesEnergyAtAnImpact) {
  for (const Integrator scheme : integrators())
    for (const double kn : {1e4, 1e6, 1e8})
      for (const double h : {5e-4, 1e-3, 5e-3, 2e-2})
        for (const double speed : {0.1, 0.77, 1.0, 3.1})
          EXPECT_LE(bounce(impact(kn), scheme, h, speed).energy, 1.03)
              << to_string(scheme) << " " << kn << " N/m " << h << " s " << speed << " m/s";
}

TEST(BoundedEnergy, IsAChoiceOfTheScene) {
  Scene scene = impact(1e8);
  const Bounce bounded = bounce(scene, Integrator::bdf2, 5e-3, 1);
  EXPECT_GE(bounded.damped, 1) << "the step says that it was damped";
  scene.solver.bounded_energy = false;
  const Bounce free = bounce(scene, Integrator::bdf2, 5e-3, 1);
  EXPECT_GT(free.energy, 1.5);
  EXPECT_EQ(free.damped, 0);
}

/// The same where friction has a spring: at the ball's own contact, or at one of a box 5 m away
/// that rests in the ground and shares nothing with the ball but the environment.
TEST(BoundedEnergy, NoSchemeCreatesEnergyBesideSpringsOfFriction) {
  for (const Integrator scheme : integrators())
    for (const double kn : {1e4, 1e6, 1e8})
      for (const double h : {1e-3, 5e-3, 2e-2})
        for (const double speed : {0.77, 3.1}) {
          Scene own = impact(kn), other = impact(kn);
          own.ground_contacts[0].coefficients.ks = kn / 4;
          other.links.push_back(
              link("box", JointType::free, {5, 0, 0.05}, CuboidShape{{0.1, 0.1, 0.1}}, 100));
          other.ground_contacts.push_back({"box", {100, 1, 0.5, 1}, ContactLaw::linear, 1e-5, {}});
          other.ground_contacts[1].coefficients.ks = 1;
          EXPECT_LE(bounce(own, scheme, h, speed).energy, 1.03)
              << to_string(scheme) << " " << kn << " N/m " << h << " s " << speed << " m/s";
          EXPECT_LE(bounce(other, scheme, h, speed).energy, 1.03)
              << to_string(scheme) << " " << kn << " N/m " << h << " s " << speed << " m/s, box";
        }
}

/// A block that slides along the ground and sticks on the spring of its friction swings about the
/// place where the spring holds nothing. That energy comes from motion, so no step is damped, and
/// the schemes of higher order keep it.
TEST(BoundedEnergy, CountsWhatASpringOfFrictionHolds) {
  constexpr double kMass = 0.1, kKs = 40, kSpeed = 0.02;
  for (const Integrator scheme : {Integrator::sdirk2, Integrator::sdirk3}) {
    Scene s;
    s.gravity = {0, 0, 0};
    s.ground = GroundDescription{};
    s.links = {link("block", JointType::prismatic, {0, 0, 0},
                    CuboidShape{{0.1, 0.1, 0.1}, {2, 2, 2}}, kMass / 1e-3)};
    s.links[0].joint.axis0 = {1, 0, 0};
    s.links[0].joint.pose.position = {0, 0, 0.0499};  // so that its normal springs hold little
    s.ground_contacts.push_back({"block", {10, 0, 100, 0}, ContactLaw::clamped, 1e-5, {}});
    s.ground_contacts[0].coefficients.ks = kKs;
    const double omega = std::sqrt(4 * kKs / kMass), h = 0.02 / omega;  // four corners touch
    const Model model(s);
    Batch batch(model, 1);
    batch.set_state(0, std::vector<double>{0}, std::vector<double>{kSpeed});
    Stepper stepper(model, testing::options(scheme, h, 1e-10));
    double most = 0;
    for (int t = 0; t < 1000; ++t) {
      stepper.step(batch, {});
      ASSERT_EQ(batch.status(0), StepStatus::converged) << to_string(scheme) << " step " << t;
      most = std::max(most, std::abs(q_of(batch)[0]));
    }
    EXPECT_NEAR(most, kSpeed / omega, 1e-3 * kSpeed / omega) << to_string(scheme);
  }
}

/// A bar that hits the limits of its joint, again and again.
TEST(BoundedEnergy, NoSchemeCreatesEnergyAtALimit) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("bar", JointType::revolute, {0, 0, 0}, CuboidShape{{0.2, 0.02, 0.02}}, 1250)};
  s.links[0].joint.axis0 = {0, 0, 1};
  s.links[0].joint.limits = {-1, 1};
  for (const Integrator scheme : integrators())
    for (const double stiffness : {1e3, 1e6})
      for (const double h : {1e-3, 5e-3, 2e-2}) {
        s.links[0].joint.limit_stiffness = stiffness;
        const Model model(s);
        Batch batch(model, 1);
        batch.set_state(0, q_of(batch), std::vector<double>{100});
        Stepper stepper(model, testing::options(scheme, h));
        for (int t = 0; t < 100; ++t) {
          stepper.step(batch, {});
          ASSERT_LE(std::abs(v_of(batch)[0]), 100.5)
              << to_string(scheme) << " " << stiffness << " N m/rad " << h << " s, step " << t;
        }
      }
}

/// Velocities change by the tenth of themselves in no step here.
TEST(BoundedEnergy, LeavesSmoothMotionAlone) {
  for (const Integrator scheme : integrators()) {
    Scene scene = testing::rolling_ball(false, 24);
    std::vector<std::vector<double>> ends;
    for (const bool bounded : {true, false}) {
      scene.solver.bounded_energy = bounded;
      const Model model(scene);
      Batch batch(model, 1);
      Stepper stepper(model, testing::options(scheme, 1e-3, 1e-9));
      for (int t = 0; t < 100; ++t) {
        testing::step_all(stepper, batch, testing::rolling_ball_control(t));
        EXPECT_EQ(batch.status(0), StepStatus::converged);
      }
      ends.push_back(q_of(batch));
    }
    EXPECT_EQ(ends[0], ends[1]) << to_string(scheme);
  }
}

/// Environments of a group come down at different times. Each has the bits that it has alone.
TEST(BoundedEnergy, BitsDoNotDependOnCompany) {
  Scene scene = impact(1e6);
  const Model model(scene);
  const auto play = [&](int environments, int first) {
    Batch batch(model, environments);
    for (int e = 0; e < environments; ++e)
      batch.set_state(e, q_of(batch, e),
                      std::vector<double>{0.1, 0, -0.5 - 0.13 * (first + e), 0, 3, 0});
    Stepper stepper(model, testing::options(Integrator::sdirk3, 2e-3));
    int damped = 0;
    std::vector<std::vector<double>> ends;
    for (int t = 0; t < 20; ++t) {
      stepper.step(batch, {});
      for (int e = 0; e < environments; ++e) damped += batch.status(e) == StepStatus::damped;
    }
    for (int e = 0; e < environments; ++e) ends.push_back(v_of(batch, e));
    return std::pair{ends, damped};
  };
  const auto [together, damped] = play(11, 0);
  EXPECT_GT(damped, 2);
  for (int e = 0; e < 11; ++e) EXPECT_EQ(together[std::size_t(e)], play(1, e).first[0]) << e;
}

TEST(BoundedEnergy, GradientsGoThroughDampedSteps) {
  for (const Integrator scheme : {Integrator::bdf2, Integrator::sdirk2, Integrator::sdirk3}) {
    SCOPED_TRACE(to_string(scheme));
    const double h = scheme == Integrator::bdf2 ? 2e-3 : 1e-3;
    testing::expect_gradient_through(Model(impact(1e5)), testing::options(scheme, h, 1e-13),
                                     {0.2, 0.1, -1, 1, 2, 3}, StepStatus::damped);
  }
}

/// A ball above a pad of a millimetre.
Scene ball_on_pad(double kn) {
  Scene s;
  s.links = {link("pad", JointType::fixed, {0, 0, -5e-4},
                  CuboidShape{{0.04, 0.04, 1e-3}, {21, 21, 2}}, 1000),
             link("ball", JointType::free, {0, 0, 0.1}, SphereShape{0.01}, 1000)};
  s.pair_contacts.push_back({"pad", "ball", {kn, 1, 0.5, 1e3}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

TEST(FastBall, IsStoppedByAThinPadOrFlagged) {
  for (const Integrator scheme : integrators())
    for (const double h : {1e-3, 5e-3, 2e-2})
      for (const double kn : {1e2, 1e5, 1e7}) {
        SCOPED_TRACE(std::string(to_string(scheme)) + " " + std::to_string(h) + " s, " +
                     std::to_string(kn) + " N/m");
        const Model model(ball_on_pad(kn));
        Batch batch(model, 1);
        batch.set_state(0, q_of(batch), std::vector<double>{0, 0, -100, 0, 0, 0});
        Stepper stepper(model, testing::options(scheme, h, 1e-9));
        bool said = false;
        for (int t = 0; t < 10; ++t) {
          stepper.step(batch, {});
          said = said || batch.status(0) == StepStatus::tunnelled;
        }
        EXPECT_TRUE(said || q_of(batch)[2] > -0.1) << q_of(batch)[2];
      }
}

/// Beside the pad there is nothing to pass.
TEST(FastBall, ThatMissesIsNotFlagged) {
  for (const Integrator scheme : integrators()) {
    const Model model(ball_on_pad(1e5));
    Batch batch(model, 1);
    std::vector<double> q = q_of(batch);
    q[0] = 0.05;
    batch.set_state(0, q, std::vector<double>{0, 0, -100, 0, 0, 0});
    Stepper stepper(model, testing::options(scheme, 5e-3));
    for (int t = 0; t < 10; ++t) {
      stepper.step(batch, {});
      EXPECT_EQ(batch.status(0), StepStatus::converged);
    }
  }
}

/// A ball of a gram that falls beside a block of 1e9 kg at rest, which it never meets.
TEST(Components, ALightBodyIsAsExactAsAlone) {
  Scene s;
  s.ground = GroundDescription{};
  s.links = {link("light", JointType::free, {0, 0, 2}, SphereShape{0.01}, 238.73241),
             link("heavy", JointType::translational, {2, 0, 0.49755},
                  CuboidShape{{1, 1, 1}, {2, 2, 2}}, 1e9)};
  s.ground_contacts.push_back({"heavy", {1e12, 1e9, 0.5, 1e10}, ContactLaw::clamped, 1e-5, {}});
  const Model model(s);
  EXPECT_EQ(compiled(model).components(), 2);
  for (const Integrator scheme : integrators()) {
    Batch batch(model, 1);
    Stepper stepper(model, testing::options(scheme, 5e-3, 1e-6));
    for (int t = 0; t < 100; ++t) stepper.step(batch, {});
    EXPECT_NEAR(v_of(batch)[2], -9.8 * 0.5, 1e-4) << to_string(scheme);
  }
}

/// Bodies that touch, and links of one tree, are one component.
TEST(Components, AreWhatJointsAndContactsConnect) {
  EXPECT_EQ(compiled(Model(testing::rolling_ball(false, 4))).components(), 1);
  EXPECT_EQ(compiled(Model(testing::two_balls())).components(), 1);
  Scene apart = testing::two_balls();
  apart.pair_contacts.pop_back();
  const Model model(apart);
  EXPECT_EQ(compiled(model).components(), 2);
  EXPECT_EQ(compiled(model).component_dofs.size(), std::size_t(model.nv()));
}

}  // namespace
}  // namespace tangere
