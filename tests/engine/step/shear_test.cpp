// SPDX-License-Identifier: Apache-2.0
// Tests shear springs against closed forms: what is held stands still, what slips does so
// by Coulomb's law, a mass is dragged as a spring and a slider would, and energy does not grow.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "kernels/table/kernel_table.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/sanitized.hpp"

namespace tangere {
namespace {

using testing::link;

constexpr double kGravity = 9.8;

struct Held {
  Model model;
  Batch batch;
  Stepper stepper;

  Held(const Scene& scene, Integrator scheme, double h, std::optional<double> tolerance = 1e-12)
      : model(scene), batch(model, 1), stepper(model, options(scheme, h, tolerance)) {}
  static StepperOptions options(Integrator scheme, double h, std::optional<double> tolerance) {
    StepperOptions o = testing::options(scheme, h);
    o.tolerance = tolerance;  // none: the one that users get
    return o;
  }
  void go(double time) {
    const int steps = int(std::lround(time / stepper.timestep()));
    const std::vector<double> u(std::size_t(model.nu()));
    for (int t = 0; t < steps && !failed(batch.status(0)); ++t) stepper.step(batch, u);
    EXPECT_FALSE(failed(batch.status(0))) << to_string(batch.status(0));
  }
  [[nodiscard]] double q(int i) const { return testing::q_of(batch)[std::size_t(i)]; }
  [[nodiscard]] double v(int i) const { return testing::v_of(batch)[std::size_t(i)]; }
};

/// A box of 0.2 kg on the ground, or on a plate, under gravity that is tilted by `angle` [deg].
Scene slope(double angle, bool on_plate, double ks, double kt = 2) {
  Scene s;
  s.name = "slope";
  const double a = angle * M_PI / 180;
  s.gravity = {kGravity * std::sin(a), 0, -kGravity * std::cos(a)};
  const Shape box = CuboidShape{{0.1, 0.1, 0.02}, {2, 2, 2}};
  const ContactCoefficients c = {2000, kt, 0.5, 2e4, ks};
  if (on_plate) {
    s.links = {link("plate", JointType::fixed, {0, 0, -0.01},
                    CuboidShape{{1000, 1, 0.02}, {2, 2, 2}}, 1000),
               link("box", JointType::free, {0, 0, 0.01}, box, 1000)};
    s.pair_contacts.push_back({"box", "plate", c, ContactLaw::clamped, 1e-5, {}});
  } else {
    s.ground = GroundDescription{};
    s.links = {link("box", JointType::free, {0, 0, 0.01}, box, 1000)};
    s.ground_contacts.push_back({"box", {2000, kt, 0.5, 20, ks}, ContactLaw::linear, 1e-5, {}});
  }
  return s;
}

using Where = std::tuple<Integrator, bool>;
class Slope : public ::testing::TestWithParam<Where> {};

TEST_P(Slope, BelowTheAngleOfFrictionABoxStandsStill) {
  const auto [scheme, on_plate] = GetParam();
  Held run(slope(20, on_plate, 500), scheme, 5e-3);
  run.go(1);
  const double x = run.q(0), z = run.q(2);
  run.go(kSanitized ? 0.5 : 9);
  EXPECT_NEAR(run.q(0), x, 1e-9);
  EXPECT_NEAR(run.q(2), z, 1e-9);
  double held = 0;  // by the springs alone
  for (const ShearEntry& e : run.batch.shear_state(0)) held -= 500 * e.s[0];
  EXPECT_NEAR(held, -0.2 * kGravity * std::sin(20 * M_PI / 180), 1e-6);
}

TEST_P(Slope, WithoutTheSpringItCreeps) {
  const auto [scheme, on_plate] = GetParam();
  Held run(slope(20, on_plate, 0), scheme, 5e-3);
  run.go(1);
  const double x = run.q(0);
  run.go(1);
  EXPECT_NEAR(run.q(0) - x, 0.2 * kGravity * std::sin(20 * M_PI / 180) / (4 * 2), 5e-3);
}

TEST_P(Slope, BeyondItTheBoxSlidesByCoulombsLaw) {
  const auto [scheme, on_plate] = GetParam();
  Held run(slope(35, on_plate, 500), scheme, 5e-3);
  run.go(0.5);
  const double v = run.v(0);
  run.go(0.5);
  const double a = 35 * M_PI / 180;
  EXPECT_NEAR((run.v(0) - v) / 0.5, kGravity * (std::sin(a) - 0.5 * std::cos(a)), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Schemes, Slope,
                         ::testing::Combine(::testing::Values(Integrator::bdf1, Integrator::bdf2,
                                                              Integrator::sdirk2),
                                            ::testing::Bool()));

/// A box of 0.2 kg between a wall and a finger that presses with 5 N, 66 points on each side.
Scene grasp(double ks, double kt) {
  Scene s;
  s.name = "grasp";
  s.gravity = {0, 0, -kGravity};
  const Shape pad = CuboidShape{{0.01, 0.03, 0.05}, {2, 6, 11}};
  LinkDescription finger = link("finger", JointType::prismatic, {0.03, 0, 0}, pad, 2000);
  finger.joint.axis0 = {-1, 0, 0};
  s.links = {link("wall", JointType::fixed, {-0.03, 0, 0}, pad, 1000), finger,
             link("box", JointType::free, {}, CuboidShape{{0.05, 0.05, 0.08}, {2, 2, 2}}, 1000)};
  s.motors.push_back({"finger_joint", -5, 5, {}});
  for (const char* body : {"wall", "finger"})
    s.pair_contacts.push_back({body, "box", {400, kt, 1, 2e4, ks}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

class Grasp : public ::testing::TestWithParam<Integrator> {};

/// It sinks by m g/(132 ks) while it is gripped and stays there.
TEST_P(Grasp, HoldsWithoutCreep) {
  Held run(grasp(100, 0.5), GetParam(), 5e-3, {});
  const auto hold = [&](double time) {
    for (int t = 0; t < int(std::lround(time / 5e-3)); ++t)
      run.stepper.step(run.batch, std::vector<double>{1});
  };
  hold(1);
  const std::vector<double> held = testing::q_of(run.batch);
  EXPECT_NEAR(held[3], -0.2 * kGravity / (132 * 100), 1e-7);
  for (int second = 0; second < (kSanitized ? 1 : 9); ++second) {
    hold(1);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(run.q(i), held[std::size_t(i)], 1e-6) << second;
  }
  Held viscous(grasp(0, 0.5), GetParam(), 5e-3, {});
  for (int t = 0; t < 40; ++t) viscous.stepper.step(viscous.batch, std::vector<double>{1});
  EXPECT_NEAR(viscous.v(3), -0.2 * kGravity / (132 * 0.5), 2e-3) << "without springs it creeps";
}

INSTANTIATE_TEST_SUITE_P(Schemes, Grasp,
                         ::testing::Values(Integrator::bdf1, Integrator::bdf2, Integrator::sdirk2,
                                           Integrator::sdirk3));

/// A skin under the box, on the plate, reads the shear that holds still when the box does: each of
/// its points has its own spring, stretched by as much as the box has moved on it.
TEST(Shear, ASkinKeepsItsShear) {
  std::vector<double> pressure[2];
  for (const double ks : {0.0, 30.0}) {
    Scene s = slope(20, true, 500);
    TactileDescription t;
    t.name = t.body = "plate";
    t.coefficients = {100, 0.1, 5, 1, ks};
    t.array = {{-0.03, -0.03, 0.01}, {0.03, 0.03, 0.01}, {1, 0, 0}, {0, 1, 0}, 7, 7};
    s.sensors.push_back(t);
    Held run(s, Integrator::bdf2, 5e-3);
    Readout readout(run.model);
    const auto shear = [&] {
      std::vector<double> field(3 * 49);
      readout.tactile(run.batch, 0, 0, std::span<double>(field));
      double sum = 0;
      for (std::size_t k = 0; k < field.size(); k += 3) sum += field[k];
      return sum;
    };
    run.go(2);
    const double early = shear();
    std::vector<double>& pressed = pressure[ks > 0 ? 1 : 0];
    pressed.resize(49);
    const std::span<double> reading[] = {pressed};
    readout.read_block(run.batch, 0, {0, FieldForm::pressure}, reading);
    run.go(kSanitized ? 0.2 : 3);
    if (ks == 0) {
      EXPECT_NEAR(shear(), 0, 1e-3);  // at rest, but for the tilt of the box
      continue;
    }
    EXPECT_NEAR(shear(), early, 1e-7);
    // The skin's normal points at the box, so what it feels is the box's pull along x.
    double moved = 0;
    for (const ShearEntry& e : run.batch.shear_state(0))
      if (e.point >= 8) moved -= e.s[0] / 49;
    EXPECT_NEAR(early, 49 * ks * moved, 1e-3);
    EXPECT_GT(early, 0.1);
  }
  EXPECT_EQ(pressure[0], pressure[1]);  // without friction: the spring is no part of it
}

TEST(Shear, ABlockIsSavedAndRestoredWithItsMemory) {
  Held run(slope(20, true, 500), Integrator::sdirk2, 5e-3);
  run.go(0.5);
  const BlockState saved = run.batch.save_block(0);
  const ShearState memory = run.batch.shear_state(0);
  EXPECT_EQ(memory.size(), 4U);
  run.go(0.2);
  const std::vector<double> went = testing::q_of(run.batch);
  run.batch.restore_block(0, saved);
  run.go(0.2);
  EXPECT_EQ(testing::q_of(run.batch), went);
  // The same from q, v and the memory, and not without it.
  const auto again = [&](bool with_memory) {
    run.batch.restore_block(0, saved);
    const std::vector<double> q = testing::q_of(run.batch), v = testing::v_of(run.batch);
    run.batch.set_state(0, q, v);
    EXPECT_TRUE(run.batch.shear_state(0).empty());
    if (with_memory) run.batch.set_shear_state(0, memory);
    run.go(0.2);
    return testing::q_of(run.batch);
  };
  EXPECT_EQ(again(true), went);
  EXPECT_GT(std::abs(again(false)[0] - went[0]), 1e-5);
}

TEST(Shear, MemoryThatTheSceneDoesNotHaveIsRefused) {
  Held run(slope(20, true, 500), Integrator::bdf1, 5e-3);
  const auto message = [&](const ShearState& memory) {
    try {
      run.batch.set_shear_state(0, memory);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(message({{0, {0, 0, 0}}, {7, {1e-4, 0, 0}}}), "");
  EXPECT_NE(message({{8, {0, 0, 0}}}).find("point 8"), std::string::npos);
  EXPECT_NE(message({{3, {0, 0, 0}}, {3, {0, 0, 0}}}).find("rising"), std::string::npos);
  EXPECT_NE(message({{1, {NAN, 0, 0}}}).find("not finite"), std::string::npos);
}

/// A mass on a belt that runs at 0.02 m/s, held by a spring of 40 N/m (docs/shear.md).
Scene dragged() {
  Scene s;
  s.name = "dragged";
  s.gravity = {0, 0, -kGravity};
  LinkDescription belt = link("belt", JointType::prismatic, {0, 0, -0.01},
                              CuboidShape{{10, 0.2, 0.02}, {2, 2, 2}}, 1e8);  // nothing slows it
  belt.joint.axis0 = {1, 0, 0};
  LinkDescription mass = link("mass", JointType::translational, {0, 0, 0.01},
                              CuboidShape{{0.1, 0.05, 0.02}, {2, 2, 2}}, 1000);  // 0.1 kg
  mass.joint.stiffness = 40;
  s.links = {belt, mass};
  s.pair_contacts.push_back(
      {"mass", "belt", {2000, 0, 0.5, 100, 125}, ContactLaw::clamped, 1e-5, {}});
  s.initial.push_back({"belt_joint", {0}, {0.02}, {}});
  return s;
}

double dragged_error(double h) {
  Scene s = dragged();
  // The mass begins at the depth at which it rests, and its springs hold x alone.
  s.initial.push_back({"mass_joint", {0, 0, -0.1 * kGravity / (4 * 2000 + 40)}, {}, {}});
  Held run(s, Integrator::bdf2, h);
  constexpr double m = 0.1, K = 40, ks = 500, V = 0.02, t = 0.4;
  run.go(t);
  const double omega = std::sqrt((K + ks) / m);
  return std::abs(run.q(1) - ks * V / (K + ks) * (t - std::sin(omega * t) / omega));
}

TEST(Shear, AMassIsDraggedAsByASpring) {
  // Second order: a quarter of the error at half the step.
  const double coarse = dragged_error(2e-3), fine = dragged_error(1e-3);
  EXPECT_LT(fine, 2e-5);
  EXPECT_NEAR(coarse / fine, 4, 0.8);
}

/// A stiffness that varies and is 0 leaves the damper alone, by another way of summing.
TEST(Shear, WithAStiffnessOfZeroOnlyTheDamperIsLeft) {
  Scene plain = slope(20, true, 0), varied = slope(20, true, 0);
  Distribution zero;
  zero.kind = Distribution::Kind::list;
  zero.values = {0};
  varied.randomizations.push_back(
      {{NumberOwner::contact, NumberField::ks, "box", 0, "plate"}, zero, {}});
  Held a(plain, Integrator::bdf2, 5e-3, 1e-9), b(varied, Integrator::bdf2, 5e-3, 1e-9);
  a.go(0.5), b.go(0.5);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(a.q(i), b.q(i), 1e-9);
}

TEST(Shear, AnEnvironmentHasTheSameBitsInEveryLane) {
  const Model model(slope(20, true, 500));
  Stepper stepper(model);
  Batch one(model, 1), many(model, 21);
  for (int t = 0; t < 60; ++t) {
    if (t == 20)
      for (int e = 0; e < 21; ++e)
        if (e % 3 == 1) many.reset(e, e);
    stepper.step(one, {});
    stepper.step(many, {});
  }
  for (const int e : {0, 8, 15, 20}) {
    EXPECT_EQ(testing::q_of(one), testing::q_of(many, e)) << e;
    ASSERT_EQ(one.shear_state(0).size(), many.shear_state(e).size());
    for (std::size_t k = 0; k < one.shear_state(0).size(); ++k)
      for (int c = 0; c < 3; ++c)
        EXPECT_EQ(one.shear_state(0)[k].s[c], many.shear_state(e)[k].s[c]);
  }
}

}  // namespace
}  // namespace tangere
