// SPDX-License-Identifier: Apache-2.0
// Tests dry friction of joints against closed forms: what is held stands still, what slips does so
// by Coulomb's law, a swing loses 2 τ/k in each half swing, and gradients agree by three routes.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/energy_balance.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/gradient_tangent.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;

constexpr double kBound = 2, kBreak = 1e-4;  // [N], [m]

/// A mass of 1 kg on a rail, with a motor of ± 10 N.
Scene rail(double stiffness = 0) {
  Scene s;
  s.name = "rail";
  s.gravity = {0, 0, 0};
  s.links = {link("mass", JointType::prismatic, {}, CuboidShape{{0.1, 0.1, 0.1}, {2, 2, 2}}, 1000)};
  JointDescription& joint = s.links[0].joint;
  joint.axis0 = {1, 0, 0};
  joint.friction = kBound;
  joint.friction_break = kBreak;
  joint.stiffness = stiffness;
  s.motors.push_back({"mass_joint", -10, 10, {}});
  return s;
}

struct DryRun {
  Model model;
  Batch batch;
  Stepper stepper;

  DryRun(const Scene& scene, Integrator scheme, double h)
      : model(scene), batch(model, 1), stepper(model, testing::options(scheme, h)) {}
  void go(double time, double force) {
    const std::vector<double> u = {force / 10};
    for (auto steps = std::lround(time / stepper.timestep()); steps > 0; --steps) {
      stepper.step(batch, u);
      ASSERT_FALSE(failed(batch.status(0))) << to_string(batch.status(0));
    }
  }
  [[nodiscard]] double q() const { return testing::q_of(batch)[0]; }
  [[nodiscard]] double v() const { return testing::v_of(batch)[0]; }
};

class DryFriction : public ::testing::TestWithParam<Integrator> {};

TEST_P(DryFriction, BelowItsBoundTheMassStandsStill) {
  DryRun run(rail(), GetParam(), 5e-3);
  run.go(3, 0.4 * kBound);  // a load that comes at once swings to twice its own displacement
  EXPECT_NEAR(run.q(), 0.4 * kBreak, 1e-12) << "as far as its spring gives way";
  const double q = run.q();
  run.go(4, 0.4 * kBound);
  EXPECT_NEAR(run.q(), q, 1e-13);
}

TEST_P(DryFriction, BeyondItTheMassSlidesByCoulombsLaw) {
  DryRun run(rail(), GetParam(), 5e-3);
  run.go(0.5, 3 * kBound);
  const double v = run.v();
  run.go(0.5, 3 * kBound);
  EXPECT_NEAR((run.v() - v) / 0.5, 2 * kBound, 1e-9);
}

/// What slips keeps the displacement at which it broke, and so does what then stops.
TEST_P(DryFriction, ASlippingSpringKeepsItsBound) {
  DryRun run(rail(), GetParam(), 5e-3);
  run.go(0.2, 3 * kBound);
  ASSERT_EQ(run.batch.shear_state(0).size(), 1U);
  const ShearEntry slipping = run.batch.shear_state(0)[0];
  EXPECT_EQ(slipping.point, 0);
  EXPECT_GT(slipping.s[0], 0);
  EXPECT_LE(slipping.s[0], kBreak);
  run.go(2, 0);
  EXPECT_NEAR(run.v(), 0, 1e-8);
  EXPECT_NEAR(run.batch.shear_state(0)[0].s[0], 0, 1e-9) << "without a load its spring is slack";
}

INSTANTIATE_TEST_SUITE_P(Schemes, DryFriction,
                         ::testing::Values(Integrator::bdf1, Integrator::bdf2, Integrator::sdirk2,
                                           Integrator::sdirk3));

/// Peaks of |q| of a swing of 0.1 m with k = 400 N/m: each is 2 τ/k below the one before.
TEST(DryFrictionSwing, LosesTwoBoundsOverStiffnessInEachHalf) {
  DryRun run(rail(400), Integrator::sdirk2, 2.5e-4);
  run.batch.set_state(0, std::vector<double>{0.1}, std::vector<double>{0.0});
  double rate = 0;
  std::vector<double> peaks;
  for (int t = 0; t < 4000 && peaks.size() < 5; ++t) {
    run.go(2.5e-4, 0);
    if (rate * run.v() < 0) peaks.push_back(std::abs(run.q()));
    rate = run.v();
  }
  ASSERT_EQ(peaks.size(), 5U);
  for (std::size_t k = 0; k < peaks.size(); ++k)
    EXPECT_NEAR(peaks[k], 0.1 - 2 * double(k + 1) * kBound / 400, 2.1 * kBreak * double(k + 1))
        << "peak " << k;
}

/// Environments have the same bits alone, in a batch and in any lane; so has a run that goes on
/// from a state with its shear state.
TEST(DryFrictionBits, AreThoseOfALoneEnvironment) {
  Scene s = rail(400);
  s.randomizations.push_back({{NumberOwner::joint, NumberField::friction, "mass_joint"},
                              {Distribution::Kind::uniform, 0.5, 4, {}},
                              {}});
  const Model model(s);
  constexpr int kCount = 19, kAll = 120, kHalf = 50;
  Batch batch(model, kCount);
  Stepper stepper(model, testing::options(Integrator::bdf2, 2e-3));
  const auto start = [&](Batch& of, int e, int as) {
    of.reset(e, as);
    of.set_state(e, std::vector<double>{0.02 * (as + 1)}, std::vector<double>{0.1});
  };
  for (int e = 0; e < kCount; ++e) start(batch, e, e);
  for (int t = 0; t < kAll; ++t) testing::step_all(stepper, batch, {0.05});
  for (const int e : {0, 7, 8, 18}) {
    SCOPED_TRACE(e);
    Batch alone(model, 1);
    Stepper single(model, testing::options(Integrator::bdf2, 2e-3));
    start(alone, 0, e);
    for (int t = 0; t < kAll; ++t) single.step(alone, std::vector<double>{0.05});
    EXPECT_EQ(testing::q_of(alone), testing::q_of(batch, e));
    EXPECT_EQ(alone.shear_state(0)[0].s[0], batch.shear_state(e)[0].s[0]);
  }
  // SDIRK2 needs no earlier state.
  DryRun whole(rail(400), Integrator::sdirk2, 2e-3), first(rail(400), Integrator::sdirk2, 2e-3),
      second(rail(400), Integrator::sdirk2, 2e-3);
  const std::vector<double> q = {0.05}, v = {0.3};
  whole.batch.set_state(0, q, v), first.batch.set_state(0, q, v);
  whole.go(kAll * 2e-3, 1), first.go(kHalf * 2e-3, 1);
  second.batch.set_state(0, testing::q_of(first.batch), testing::v_of(first.batch));
  second.batch.set_shear_state(0, first.batch.shear_state(0));
  second.go((kAll - kHalf) * 2e-3, 1);
  EXPECT_EQ(whole.q(), second.q());
}

/// A random machine with dry friction in the joints that may have it, some of which slip.
Scene dry_machine(unsigned seed, int links) {
  Scene s = testing::random_machine(seed, links);
  testing::Random random(seed + 400);
  for (LinkDescription& l : s.links) {
    const JointType type = l.joint.type;
    if (type == JointType::fixed || type == JointType::spherical || type == JointType::free)
      continue;
    l.joint.friction = random.uniform(0.02, 0.5);
    l.joint.friction_break = random.uniform(2e-3, 2e-2);
    l.joint.friction_time = random.uniform(1e-3, 1e-2);
    if (l.joint.turning) l.joint.turning->friction = 0.1;
  }
  return s;
}

/// Counts the dofs that stick and that slip at the ends of the steps of a run.
std::array<int, 2> count_states(const Scene& scene, Integrator scheme, unsigned seed, int steps) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(scheme, scene.timestep));
  const testing::RunInput in = testing::random_input(model, seed, steps);
  batch.set_state(0, in.q, in.v);
  std::array<int, 2> counts{};
  std::vector<double> before;
  for (const auto& u : in.u) {
    const std::vector<double> q = testing::q_of(batch);
    ShearState state = batch.shear_state(0);
    stepper.step(batch, u);
    const std::vector<double> after = testing::q_of(batch);
    for (std::size_t k = 0; k < state.size(); ++k) {
      // Where it sticks, the displacement grows by the motion of a coordinate.
      const double grown = batch.shear_state(0)[k].s[0] - state[k].s[0];
      bool sticks = false;
      for (std::size_t i = 0; i < q.size(); ++i)
        sticks = sticks || std::abs(after[i] - q[i] - grown) < 1e-12;
      ++counts[sticks ? 0 : 1];
    }
  }
  return counts;
}

constexpr int kDrySteps = 6;

TEST_P(DryFriction, GradientsMatchDifferencesAndTangents) {
  int compared = 0, tangents = 0;
  std::array<int, 2> counts{};
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene = dry_machine(seed, 2 + static_cast<int>(seed % 4));
    const auto [sticking, slipping] = count_states(scene, GetParam(), seed, kDrySteps);
    counts[0] += sticking, counts[1] += slipping;
    compared += testing::check_gradient(scene, GetParam(), seed, kDrySteps, 1e-6);
    const Model model(scene);
    tangents += testing::check_tangent(model, testing::options(GetParam(), scene.timestep, 1e-13),
                                       testing::random_input(model, seed, kDrySteps), seed);
  }
  EXPECT_GT(compared, 60);
  EXPECT_GE(tangents, 4);
  EXPECT_GT(counts[0], 3);
  EXPECT_GT(counts[1], 3);
}

/// What the motor does is what the mass has, its spring holds and friction takes.
TEST(DryFrictionAudit, BalancesWithoutAnErrorOfItsOwn) {
  DryRun run(rail(), Integrator::sdirk3, 1e-4);
  EnergyBalanceReader reader(run.model);
  const std::vector<double> u = {0.6};
  EnergyBalance before = reader.read(run.batch, 0, u);
  double error = 0, taken = 0;
  for (int t = 0; t < 2000; ++t) {
    run.stepper.step(run.batch, u);
    const EnergyBalance after = reader.read(run.batch, 0, u);
    const StepEnergyBalance step = between(before, after, 1e-4);
    error += step.integrator_error, taken += step.dissipated;
    before = after;
  }
  EXPECT_NEAR(taken, kBound * run.q(), 0.01 * kBound * run.q());
  EXPECT_LT(std::abs(error), 0.01 * taken);
}

TEST(DryFrictionFaults, AJointThatTurnsFreelyHasNone) {
  Scene s = rail();
  s.links[0].joint.type = JointType::free;
  s.motors.clear();
  EXPECT_THROW(Model{s}, InputError);
}

}  // namespace
}  // namespace tangere
