// SPDX-License-Identifier: Apache-2.0
// Tests that the books of energy balance: what motors do and what damping and friction take is all
// that changes the energy of an accurate run. That is an independent check of every power, because
// the energies come from positions and speeds alone.
#include "engine/sense/energy_balance.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/base/vector3.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

struct Books {
  double motors = 0, taken = 0, made = 0;  ///< sums
  double made_at_most = 0;                 ///< |made| of a step
  EnergyBalance last;
};

/// Plays a run from (q, v) and audits every step.
Books play(const Scene& scene, const testing::RunInput& in, Integrator scheme, double h, int steps,
           int parts) {
  const Model model(scene);
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, testing::options(scheme, h / parts));
  EnergyBalanceReader auditor(model);
  Books books;
  for (int t = 0; t < steps * parts; ++t) {
    const std::vector<double>& u = in.u[std::size_t(t / parts)];
    const EnergyBalance start = auditor.read(batch, 0, u);
    stepper.step(batch, u);
    EXPECT_FALSE(failed(batch.status(0)));
    books.last = auditor.read(batch, 0, u);
    const StepEnergyBalance step = between(start, books.last, stepper.timestep());
    books.motors += step.motor_work;
    books.taken += step.dissipated;
    books.made += step.integrator_error;
    books.made_at_most = std::max(books.made_at_most, std::abs(step.integrator_error));
  }
  return books;
}

/// All joints, springs, limits, motors of both kinds, armatures, massless bodies.
TEST(Audit, BooksOfMachinesBalance) {
  for (unsigned seed = 0; seed < 12; ++seed) {
    Scene scene = testing::random_machine(seed, 5);
    if (seed % 2 == 1) testing::share_gravity(scene, seed);
    const testing::RunInput in = testing::random_input(Model(scene), seed, 10);
    const Books coarse = play(scene, in, Integrator::sdirk3, 1e-3, 10, 1),
                fine = play(scene, in, Integrator::sdirk3, 1e-3, 10, 16);
    const double passed =
        std::abs(fine.motors) + fine.taken + fine.last.kinetic + fine.last.elastic;
    EXPECT_LE(std::abs(fine.made), 1e-3 * passed) << seed << " of " << passed << " J";
    EXPECT_LE(std::abs(fine.made), 0.1 * std::abs(coarse.made) + 1e-9 * passed) << seed;
    EXPECT_GE(fine.taken, 0) << seed;
  }
}

/// Touching bodies, with every law that has an energy.
TEST(Audit, BooksOfContactsBalance) {
  for (const ContactLaw law : {ContactLaw::clamped, ContactLaw::paper, ContactLaw::linear})
    for (unsigned seed = 0; seed < 6; ++seed) {
      const Scene scene = testing::random_contacts(seed, 4, law);
      const testing::RunInput in = testing::random_input(Model(scene), seed, 8);
      const Books fine = play(scene, in, Integrator::sdirk3, 1e-3, 8, 32);
      const double passed = fine.taken + fine.last.kinetic + fine.last.elastic;
      EXPECT_LE(std::abs(fine.made), 1e-3 * passed)
          << seed << " law " << int(law) << " of " << passed << " J";
    }
}

/// A ball meets a spring without damping. BDF1 takes nearly all of its energy.
TEST(Audit, SaysWhatTheSchemeTook) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.ground = GroundDescription{};
  s.links = {link("ball", JointType::free, {0, 0, 0.0123}, SphereShape{0.01}, 2387.3241)};
  s.ground_contacts.push_back({"ball", {1e4, 0, 0, 0}, ContactLaw::clamped, 1e-5, {}});
  testing::RunInput in;
  in.q = q_of(Batch(Model(s), 1));
  in.v = {0, 0, -1, 0, 0, 0};
  in.u.assign(20, {});
  const Books books = play(s, in, Integrator::bdf1, 5e-3, 20, 1);
  const double start = 0.5 * Model(s).mass(0);
  EXPECT_EQ(books.motors, 0);
  EXPECT_EQ(books.taken, 0);
  EXPECT_NEAR(books.made, books.last.energy() - start, 1e-15);
  EXPECT_LT(books.made, -0.9 * start);
  EXPECT_NEAR(books.last.momentum[2],
              Model(s).mass(0) * std::sqrt(2 * books.last.kinetic / Model(s).mass(0)), 1e-12);
}

/// Friction takes the energy of a cube that slides to a stop.
TEST(Audit, SaysWhatFrictionTook) {
  Scene s;
  s.ground = GroundDescription{};
  s.links = {link("cube", JointType::translational, {0, 0, 0.025},
                  CuboidShape{{0.05, 0.05, 0.05}, {2, 2, 2}}, 1000)};
  s.ground_contacts.push_back({"cube", {1e4, 100, 0.5, 100}, ContactLaw::linear, 1e-5, {}});
  testing::RunInput in;
  in.q = {0, 0, -0.125 * 9.8 / 4e4};
  in.v = {1, 0, 0};
  in.u.assign(400, {});
  const Books books = play(s, in, Integrator::sdirk2, 1e-3, 400, 1);
  EXPECT_NEAR(books.taken, 0.0625, 1e-3 * 0.0625);
  EXPECT_LE(std::abs(books.made), 1e-3 * 0.0625);
}

/// A body that nothing touches keeps both momenta, also where its centre is aside of its joint and
/// the scene is far from the world's origin.
TEST(Audit, MomentumOfAFreeBodyStays) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("box", JointType::free, {300, 0, 0}, CuboidShape{{0.06, 0.04, 0.02}}, 1000)};
  s.links[0].body.pose.position = {0.03, -0.02, 0.01};
  testing::RunInput in;
  in.q = q_of(Batch(Model(s), 1));
  in.v = {0.3, -0.2, 0.5, 2, 9, 3};
  in.u.assign(200, {});
  const Model model(s);
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  const EnergyBalance start = EnergyBalanceReader(model).read(batch, 0, {});
  const Books end = play(s, in, Integrator::sdirk3, 1e-3, 200, 1);
  // Its centre moves with v + ω × c, and 300 m of arm carry that into the angular momentum.
  EXPECT_NEAR(start.momentum[1], model.mass(0) * (-0.2 + 3 * 0.03 - 2 * 0.01), 1e-12);
  EXPECT_NEAR(start.momentum[5], 300 * start.momentum[1], 1e-2);
  for (std::size_t k = 0; k < 6; ++k)
    EXPECT_NEAR(end.last.momentum[k], start.momentum[k], k < 3 ? 1e-6 : 1e-4) << k;
}

/// −Σ m gravity·x is that of the world, also where the scene is measured from its middle.
TEST(Audit, HeightIsThatInTheWorld) {
  Scene s;
  s.links = {link("box", JointType::free, {0, 0, 500}, CuboidShape{{0.06, 0.04, 0.02}}, 1000)};
  const Model model(s);
  EXPECT_TRUE(compiled(model).moved);
  EXPECT_NEAR(EnergyBalanceReader(model).read(Batch(model, 1), 0, {}).potential,
              model.mass(0) * 9.8 * 500, 1e-9);
}

/// Numbers of a scene that vary are those of the environment, and a batch has the bits of one.
TEST(Audit, IsThatOfTheEnvironment) {
  Scene scene = testing::rolling_ball(false, 16);
  RandomizationDescription density;
  density.number = {NumberOwner::body, NumberField::density, "pad", 0};
  density.distribution = {Distribution::Kind::uniform, 500, 1500, {}};
  scene.randomizations.push_back(density);
  const Model model(scene);
  Batch batch(model, 20, 3);
  Stepper stepper(model);
  for (int t = 0; t < 90; ++t) testing::step_all(stepper, batch, testing::rolling_ball_control(t));
  EnergyBalanceReader together(model);
  double least = HUGE_VAL, most = 0;
  for (int e = 0; e < 20; ++e) {
    Batch one(model, 1, 3, e);
    for (int t = 0; t < 90; ++t) testing::step_all(stepper, one, testing::rolling_ball_control(t));
    const std::vector<double> u = testing::rolling_ball_control(90);
    const EnergyBalance a = together.read(batch, e, u),
                        b = EnergyBalanceReader(model).read(one, 0, u);
    EXPECT_EQ(a.energy(), b.energy()) << e;
    EXPECT_EQ(a.motor_power, b.motor_power) << e;
    EXPECT_EQ(a.dissipation, b.dissipation) << e;
    EXPECT_EQ(a.momentum, b.momentum) << e;
    least = std::min(least, a.potential), most = std::max(most, a.potential);
  }
  EXPECT_GT(most, 1.2 * least);
}

}  // namespace
}  // namespace tangere
