// SPDX-License-Identifier: Apache-2.0
// Tests the hysteresis of sensors, a share of the answer that is late, against the closed form of a
// Maxwell element, and its memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using testing::Pad;

/// A sphere in a pad whose answer is late, low-passed and delayed.
Scene late_scene(double share, double lag, double low_pass) {
  Scene s = testing::pad_scene(PrimitiveShape::sphere, ContactLaw::clamped, Pad::flat);
  SensorImperfections& i = s.sensors[0].imperfections;
  i.hysteresis = share, i.hysteresis_time = lag, i.low_pass = low_pass, i.delay = 0.0125;
  return s;
}

Batch touching(const Model& model, int environments) {
  Batch batch(model, environments, 3);
  testing::Random random(7);
  for (int e = 0; e < environments; ++e) {
    const testing::PadState s = testing::random_pad_state(model, random);
    batch.set_state(e, s.q, s.v);
  }
  return batch;
}

std::vector<double> reading(Readout& readout, const Batch& batch, int environment, FieldForm form) {
  DenseFrame<double> frame(batch.model(), 0, form);
  readout.read(batch, environment, frame);
  return {frame.values().begin(), frame.values().end()};
}

/// A pad on a spring swings without a loss inside of a block, so its field is a cosine. A share a
/// of the answer has the lag τ: over a swing the reading y encloses, against the ideal field x,
///   ∮ y dx = π X² a ωτ/(1 + (ωτ)²),
/// which vanishes for slow and for fast swings.
TEST(LateAnswer, EnclosesTheLoopOfAMaxwellElement) {
  constexpr double kShare = 0.3, kStep = 1e-3, kPeriod = 0.5, kRestHeight = 2e-3, kSwing = 1e-3;
  constexpr double kOmega = 2 * std::numbers::pi / kPeriod;
  const std::vector<double> lags = {0.01, 0.08, 0.3};
  Scene s;
  s.gravity = {0, 0, 0};
  s.timestep = kStep;
  s.integrator = Integrator::sdirk3;
  s.solver.tolerance = 1e-12;
  s.links = {testing::link("pad", JointType::prismatic, {0, 0, 0},
                           CuboidShape{{0.02, 0.02, 0.02}, {2, 2, 2}}, 1000),
             testing::link("block", JointType::fixed, {0, 0, -0.06 + kRestHeight},
                           CuboidShape{{0.1, 0.1, 0.1}, {2, 2, 2}}, 1000)};
  s.links[0].joint.axis0 = {0, 0, 1};
  s.links[0].joint.stiffness = kOmega * kOmega * 8e-6 * 1000;
  s.initial.push_back({"pad_joint", {kSwing}, {}, {}});
  for (const double lag : lags) {
    TactileDescription t;
    t.name = "skin" + std::to_string(lag);
    t.body = "pad";
    t.coefficients = {100, 0, 0, 0};
    t.array = {{-0.001, -0.001, -0.01}, {0.001, 0.001, -0.01}, {1, 0, 0}, {0, -1, 0}, 1, 1};
    t.imperfections.hysteresis = kShare;
    t.imperfections.hysteresis_time = lag;
    s.sensors.push_back(t);
  }
  const Model model(s);
  Batch batch(model, 1);
  Stepper stepper(model);
  Readout readout(model);
  const int swing = int(std::lround(kPeriod / kStep));
  std::vector<double> field(3), before_x(lags.size()), before_y(lags.size()), area(lags.size()),
      low(lags.size(), HUGE_VAL), high(lags.size(), -HUGE_VAL);
  // Five swings until the start is forgotten, then one more, from one step before it.
  for (int t = 0; t <= 6 * swing; ++t) {
    if (t > 0) stepper.step(batch, {});
    if (t < 5 * swing - 1) continue;
    for (std::size_t k = 0; k < lags.size(); ++k) {
      DenseFrame<double> ideal(model, int(k), FieldForm::ideal), read(model, int(k));
      readout.read(batch, 0, ideal), readout.read(batch, 0, read);
      const double x = std::abs(ideal.values()[2]), y = std::abs(read.values()[2]);
      if (t >= 5 * swing) area[k] += 0.5 * (y + before_y[k]) * (x - before_x[k]);
      low[k] = std::min(low[k], x), high[k] = std::max(high[k], x);
      before_x[k] = x, before_y[k] = y;
    }
  }
  for (std::size_t k = 0; k < lags.size(); ++k) {
    const double amplitude = 0.5 * (high[k] - low[k]), w = kOmega * lags[k];
    EXPECT_NEAR(amplitude, 100 * kSwing, 1e-3 * 100 * kSwing);
    const double disc = std::numbers::pi * amplitude * amplitude * kShare,
                 expected = disc * w / (1 + w * w), left = std::exp(-kStep / lags[k]);
    // The lag of sampled states is half a step shorter than τ.
    EXPECT_NEAR(std::abs(area[k]), expected, (0.005 + 0.6 * kStep / lags[k]) * expected) << lags[k];
    const std::complex<double> sampled =
        (1 - left) / (1.0 - left * std::polar(1.0, -kOmega * kStep));
    EXPECT_NEAR(std::abs(area[k]), disc * std::abs(sampled.imag()), 0.005 * expected) << lags[k];
  }
  EXPECT_GT(std::abs(area[1]), 2 * std::abs(area[0])) << "slow against the lag";
  EXPECT_GT(std::abs(area[1]), 2 * std::abs(area[2])) << "fast against the lag";
}

/// A force that is held is read as it is, and what no share is late is ideal.
TEST(LateAnswer, KeepsWhatIsHeld) {
  for (const double low_pass : {0.0, 0.01}) {
    const Model model(late_scene(0.4, 0.03, low_pass));
    Batch batch = touching(model, 3);
    Readout readout(model);
    for (int e = 0; e < 3; ++e) {
      const std::vector<double> ideal = reading(readout, batch, e, FieldForm::ideal),
                                read = reading(readout, batch, e, FieldForm::field);
      for (std::size_t i = 0; i < read.size(); ++i)
        EXPECT_NEAR(read[i], ideal[i], 1e-14 + 1e-13 * std::abs(ideal[i]));
    }
  }
  Scene scene = late_scene(0, 0, 0);
  scene.sensors[0].imperfections.delay = 0;
  const Model off(scene);
  scene.sensors[0].imperfections = {};
  const Model plain(scene);
  EXPECT_EQ(off.state_bytes_per_environment(), plain.state_bytes_per_environment());
  EXPECT_FALSE(off.sensors()[0].imperfect);
}

/// What is late comes from states that blocks keep: a block that is restored goes on alike.
TEST(LateAnswer, GoesOnFromASavedBlock) {
  const Model model(late_scene(0.5, 0.02, 0));
  Batch batch = touching(model, 32);
  Readout readout(model);
  Stepper stepper(model);
  const std::vector<double> u(32 * std::size_t(model.nu()));
  for (int t = 0; t < 9; ++t) stepper.step(batch, u);
  const BlockState saved = batch.save_block(1);
  std::vector<std::vector<double>> first;  // of all environments of block 1
  for (int t = 0; t < 6; ++t) {
    stepper.step(batch, u);
    first.emplace_back();
    for (int e = 16; e < 32; ++e)
      for (const double x : reading(readout, batch, e, FieldForm::field)) first.back().push_back(x);
  }
  batch.restore_block(1, saved);
  double late = 0;
  for (int t = 0; t < 6; ++t) {
    stepper.step(batch, u);
    std::vector<double> again, ideal;
    for (int e = 16; e < 32; ++e) {
      for (const double x : reading(readout, batch, e, FieldForm::field)) again.push_back(x);
      for (const double x : reading(readout, batch, e, FieldForm::ideal)) ideal.push_back(x);
    }
    EXPECT_EQ(again, first[std::size_t(t)]);
    for (std::size_t i = 0; i < ideal.size(); ++i)
      late = std::max(late, std::abs(ideal[i] - again[i]));
  }
  EXPECT_GT(late, 0);
  batch.reset(17, 1);
  EXPECT_EQ(batch.steps(17), 0) << "an episode begins anew";
}

}  // namespace
}  // namespace tangere
