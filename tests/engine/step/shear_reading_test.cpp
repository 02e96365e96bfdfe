// SPDX-License-Identifier: Apache-2.0
// Tests skins whose memory advances only at steps at which they are due to be read: what they keep
// is what a memory of every step keeps where points stick or slip straight on, and they have the
// same bits in any batch.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/readout.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;

/// A plate that two motors press down and move along x. Under it lies a slab with a skin that
/// remembers, alone of all contacts. `every`: steps from one advance of memory to the next; 0: it
/// advances at every step.
Scene dragged(int every, double mu) {
  Scene s;
  s.name = "dragged";
  s.timestep = 2e-3;
  s.integrator = Integrator::bdf1;
  s.gravity = {0, 0, 0};
  LinkDescription plate = link("plate", JointType::translational, {0, 0, 0.0095},
                               CuboidShape{{1, 1, 0.01}, {2, 2, 2}}, 100);
  plate.joint.damping = 200;
  s.links = {link("slab", JointType::fixed, {}, CuboidShape{{0.04, 0.04, 0.01}, {4, 4, 2}}, 1000),
             plate};
  s.motors.push_back({"plate_joint", -5, 5, {}});
  s.pair_contacts.push_back({"slab", "plate", {400, 0, 0, 1e3}, ContactLaw::clamped, 1e-5, {}});
  TactileDescription skin;
  skin.name = "skin", skin.body = "slab";
  skin.coefficients = {100, 0.1, mu, 0, 60};
  skin.array = {{-0.015, -0.015, 0.005}, {0.015, 0.015, 0.005}, {1, 0, 0}, {0, 1, 0}, 4, 4};
  skin.every = every;
  skin.shear_at_readings = every > 0;
  s.sensors.push_back(skin);
  return s;
}

/// Σ over all points of the field [N].
std::array<double, 3> whole(Readout& readout, const Batch& batch, int environment = 0) {
  std::vector<double> field(48);
  readout.tactile(batch, environment, 0, std::span<double>(field));
  std::array<double, 3> sum{};
  for (std::size_t k = 0; k < 48; ++k) sum[k % 3] += field[k];
  return sum;
}

struct Drag {
  Model model;
  Batch batch;
  Stepper stepper;
  Readout readout;
  Drag(int every, double mu)
      : model(dragged(every, mu)), batch(model, 1), stepper(model), readout(model) {}
  void go(int steps, double u) {
    const std::vector<double> all = {u, 0.3 * u, -0.2};
    for (int t = 0; t < steps; ++t) stepper.step(batch, all);
    EXPECT_FALSE(failed(batch.status(0)));
  }
};

TEST(ShearReading, KeepsWhatStickingPointsKeepAtEveryStep) {
  Drag step(0, 50), read(7, 50);
  for (Drag* d : {&step, &read}) d->go(7, 0.1);
  EXPECT_EQ(read.batch.shear_state(0).size(), 2U * 16) << "b and a of 16 points";
  const auto first = whole(step.readout, step.batch), begun = whole(read.readout, read.batch);
  EXPECT_NEAR(begun[2], first[2], 1e-12) << "pressure does not remember";
  EXPECT_GT(std::abs(first[0]), 1e-3);
  // They begin unsheared at the first reading: the shear before it is missing for good.
  const double missing = first[0] - begun[0];
  for (const int steps : {3, 11, 7}) {  // between readings, too
    for (Drag* d : {&step, &read}) d->go(steps, 0.1);
    const auto all = whole(step.readout, step.batch), now = whole(read.readout, read.batch);
    EXPECT_NEAR(all[0] - now[0], missing, 1e-9 * std::abs(all[0])) << steps;
  }
}

TEST(ShearReading, SlipsToTheSameBound) {
  Drag step(0, 0.3), read(5, 0.3);
  for (Drag* d : {&step, &read}) d->go(400, 0.5);
  const auto all = whole(step.readout, step.batch), now = whole(read.readout, read.batch);
  EXPECT_NEAR(std::hypot(all[0], all[1]), 0.3 * std::abs(all[2]), 1e-9);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(now[c], all[c], 1e-6 * std::abs(all[2])) << c;
}

TEST(ShearReading, ForgetsPointsThatLeave) {
  Drag read(5, 50);
  read.go(20, 0.1);
  EXPECT_FALSE(read.batch.shear_state(0).empty());
  const std::vector<double> up = {0, 0, 1};
  for (int t = 0; t < 200; ++t) read.stepper.step(read.batch, up);
  EXPECT_TRUE(read.batch.shear_state(0).empty());
}

/// Lanes of a group are due at steps of their own episodes.
TEST(ShearReading, HasTheSameBitsInAnyBatch) {
  const Model model(dragged(5, 0.5));
  Stepper stepper(model);
  Readout readout(model);
  const auto control = [](int e, int t) {
    return std::vector<double>{0.02 * (e + 1) * std::cos(0.1 * t), 0.1, -0.2};
  };
  Batch batch(model, 19);
  for (int t = 0; t < 43; ++t) {
    std::vector<double> u;
    for (int e = 0; e < 19; ++e) {
      if (t == e) batch.reset(e, e);
      const auto own = control(e, t);
      u.insert(u.end(), own.begin(), own.end());
    }
    stepper.step(batch, u);
  }
  for (int e = 0; e < 19; ++e) {
    Batch alone(model, 1, 0, e);
    for (int t = e; t < 43; ++t) stepper.step(alone, control(e, t));
    EXPECT_EQ(testing::q_of(alone, 0), testing::q_of(batch, e));
    const ShearState &one = alone.shear_state(0), &other = batch.shear_state(e);
    ASSERT_EQ(one.size(), other.size()) << e;
    EXPECT_EQ(one.size(), 32U);
    for (std::size_t k = 0; k < one.size(); ++k)
      for (int c = 0; c < 3; ++c) EXPECT_EQ(one[k].s[c], other[k].s[c]) << e << " " << k;
    EXPECT_EQ(whole(readout, alone), whole(readout, batch, e)) << e;
  }
}

}  // namespace
}  // namespace tangere
