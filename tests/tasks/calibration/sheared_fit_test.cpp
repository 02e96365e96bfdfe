// SPDX-License-Identifier: Apache-2.0
// A ball is pressed into a small gel and moved along it: stiffness, zero, springs and friction of
// the two recorded forces are fitted together, slow and at a speed.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <optional>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tests/tasks/calibration/gel_press.hpp"

namespace tangere {
namespace {

using testing::add_noise;
using testing::gel_press;

constexpr double kShearZero = 2e-5;

CalibrationRequest shear_request(bool layer) {
  CalibrationRequest request;
  request.scene = [layer](const SkinNumbers& numbers) { return gel_press(numbers, layer); };
  request.start = {{"modulus", 1e5}, {"ks", 2e7}, {"mu", 0.8}};
  return request;
}

/// In by 0.3 mm, and along x by 0.4 mm.
PressRecording shear_path() {
  PressRecording out;
  for (int k = 1; k <= 8; ++k) out.depth.push_back(3.75e-5 * k), out.shear.push_back(0);
  for (int k = 1; k <= 12; ++k) out.depth.push_back(3e-4), out.shear.push_back(4e-4 / 12 * k);
  return out;
}

/// What the ball of a recording's rows feels when it is `zero` deeper, slowly.
void record_slowly(const Scene& scene, double zero, PressRecording& r) {
  std::vector<double> depth = r.depth;
  for (double& d : depth) d += zero;
  const PathForces forces =
      path_forces(scene, {.depth = depth, .rate = {}, .time = {}, .x = r.shear, .y = {}});
  r.force = forces.normal, r.shear_force = forces.tangential;
}

const SkinNumbers kSlowTruth{{"modulus", 2e5}, {"zero", kShearZero}, {"ks", 5e7}, {"mu", 0.5}};

TEST(ShearedFit, StiffnessAndFrictionAreFoundTogether) {
  for (const bool layer : {false, true}) {
    const CalibrationRequest request = shear_request(layer);
    PressRecording r = shear_path();
    record_slowly(request.scene(kSlowTruth), kShearZero, r);
    const Calibration found = calibrate(request, r);
    ASSERT_EQ(found.numbers.size(), kSlowTruth.size()) << layer;
    EXPECT_NEAR(found.found.at("modulus"), 2e5, 5e-4 * 2e5) << layer;
    EXPECT_NEAR(found.found.at("zero"), kShearZero, 1e-7) << layer;
    EXPECT_NEAR(found.found.at("ks"), 5e7, 2e-3 * 5e7) << layer;
    EXPECT_NEAR(found.found.at("mu"), 0.5, 1e-3) << layer;
    EXPECT_LT(found.normal.largest, 1e-3) << layer;
    EXPECT_LT(found.shear.largest, 1e-3) << layer;
    EXPECT_GT(found.friction.largest, 0.01) << "friction adds to the normal force";
    EXPECT_TRUE(found.friction.moved.empty()) << "the fit has it";
  }
}

/// Noise of two sizes: 0.5 % of the peak along the normal, a fifth of it along the skin.
TEST(ShearedFit, IntervalsContainTheTruth) {
  constexpr int kSheared = 8;
  const CalibrationRequest request = shear_request(false);
  PressRecording exact = shear_path();
  record_slowly(request.scene(kSlowTruth), kShearZero, exact);
  const double peak = *std::ranges::max_element(exact.force);
  std::map<std::string, int> inside;
  std::mt19937 random(11);
  for (int k = 0; k < kSheared; ++k) {
    PressRecording r = exact;
    add_noise(r.force, 5e-3 * peak, random), add_noise(r.shear_force, 1e-3 * peak, random);
    for (const FittedNumber& x : calibrate(request, r).numbers) {
      inside[x.name] += kSlowTruth.at(x.name) >= x.low && kSlowTruth.at(x.name) <= x.high;
      EXPECT_LT(x.high - x.low, x.name == "zero" ? 2e-5 : 0.1 * x.value) << x.name;
    }
  }
  ASSERT_EQ(inside.size(), kSlowTruth.size());
  for (const auto& [name, count] : inside) EXPECT_GE(count, 7) << name;
}

/// A fast press and shear, made by a stepper with several steps from row to row.
TEST(ShearedFit, RelaxationOfAFastShearIsInTheModel) {
  constexpr int kSteps = 4;
  constexpr double kRow = 4e-3, kTau = 0.02;
  CalibrationRequest request = shear_request(false);
  request.start["relaxation"] = 5e-3;
  const SkinNumbers truth{{"modulus", 2e5}, {"relaxation", kTau}, {"ks", 5e7}, {"mu", 0.5}};
  const Model model(request.scene(truth));
  Stepper stepper(model, {.timestep = kRow / kSteps});
  Batch batch(model, 1);
  Readout readout(model);
  batch.set_state(0, std::array<double, 3>{0, 0, 1e-4}, std::array<double, 3>{});
  const auto depth = [](double row) { return std::min(2.5e-5 * row, 3e-4) + kShearZero; };
  const auto shear = [](double row) { return 2.5e-5 * std::clamp(row - 16, 0.0, 20.0); };
  PressRecording r;
  for (int k = 1; k <= 40; ++k) {
    for (int step = 1; step <= kSteps; ++step) {
      const double row = k - 1 + double(step) / kSteps;
      stepper.step(batch, std::array<double, 3>{shear(row), 0, -depth(row)});
    }
    std::array<double, 6> sum{};
    std::span<double> reading = sum;
    readout.read_block(batch, 0, FieldOutput{0, FieldForm::sum}, {&reading, 1});
    r.time.push_back(kRow * k), r.depth.push_back(depth(k) - kShearZero);
    r.shear.push_back(shear(k));
    r.force.push_back(-sum[2]), r.shear_force.push_back(sum[0]);
  }
  const Calibration found = calibrate(request, r);
  EXPECT_NEAR(found.found.at("modulus"), 2e5, 5e-3 * 2e5);
  EXPECT_NEAR(found.found.at("relaxation"), kTau, 0.02 * kTau);
  EXPECT_NEAR(found.found.at("ks"), 5e7, 0.03 * 5e7);
  EXPECT_NEAR(found.found.at("mu"), 0.5, 0.01);
  EXPECT_NEAR(found.found.at("zero"), kShearZero, 1e-6);
  r.time.clear();  // without rates mu and ks take up what the speed does
  EXPECT_GT(std::abs(calibrate(request, r).found.at("mu") - 0.5), 0.02);
}

}  // namespace
}  // namespace tangere
