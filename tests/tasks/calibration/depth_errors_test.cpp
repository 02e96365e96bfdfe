// SPDX-License-Identifier: Apache-2.0
// Recordings whose depths are noisy or rounded: the intervals of fits contain the truth, slopes are
// not attenuated, and the size of the errors is told where it can be.
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "engine/base/error.hpp"
#include "tests/tasks/calibration/gel_press.hpp"

namespace tangere {
namespace {

using testing::add_noise;
using testing::gel_press;

constexpr int kDepthRecordings = 8;
constexpr double kCellNoise = 2e-3;  // of the peak

CalibrationRequest depth_request(bool relaxes) {
  CalibrationRequest request;
  request.scene = [](const SkinNumbers& numbers) { return gel_press(numbers, false); };
  request.start = {{"modulus", 1e5}};
  if (relaxes) request.start["relaxation"] = 5e-3;
  return request;
}

const SkinNumbers kDepthTruth{{"modulus", 2e5}, {"zero", 0}, {"relaxation", 0.02}};

/// A sine from 0.1 to 0.5 mm in 60 rows, with exact depths; at a speed, or slow without times.
PressRecording exact_press(const CalibrationRequest& request, bool relaxes) {
  PressRecording r;
  for (int k = 0; k < 60; ++k) {
    r.depth.push_back(3e-4 - 2e-4 * std::cos(2 * 3.14159265 * k / 60));
    if (relaxes) r.time.push_back(5e-3 * k);
  }
  const std::vector<double> rate = r.rates();
  r.force = press_forces(request.scene(relaxes ? kDepthTruth : SkinNumbers{{"modulus", 2e5}}),
                         {.depth = r.depth, .rate = rate, .time = {}, .x = {}, .y = {}});
  return r;
}

/// How many intervals contain the truth, and the mean of what is found, by the truth's.
struct Covered {
  std::map<std::string, int> inside;
  std::map<std::string, double> mean;
  int estimated = 0;
};
Covered cover(const CalibrationRequest& request, const PressRecording& exact, double depth_noise) {
  Covered out;
  std::mt19937 random(5);
  const double peak = *std::ranges::max_element(exact.force);
  for (int k = 0; k < kDepthRecordings; ++k) {
    PressRecording r = exact;
    add_noise(r.depth, depth_noise, random), add_noise(r.force, kCellNoise * peak, random);
    const Calibration found = calibrate(request, r);
    out.estimated += found.depth_error.estimated;
    for (const FittedNumber& x : found.numbers) {
      const double truth = kDepthTruth.at(x.name);
      out.inside[x.name] += truth >= x.low && truth <= x.high;
      out.mean[x.name] += x.value / kDepthRecordings;
    }
  }
  return out;
}

TEST(DepthErrors, IntervalsContainTheTruth) {
  CalibrationRequest request = depth_request(false);
  const PressRecording exact = exact_press(request, false);
  const Covered with = cover(request, exact, 1e-5);
  EXPECT_GE(with.estimated, 0.9 * kDepthRecordings);
  for (const auto& [name, count] : with.inside) EXPECT_GE(count, 0.8 * kDepthRecordings) << name;
  EXPECT_NEAR(with.mean.at("modulus"), 2e5, 0.01 * 2e5);
}

/// Rates of noisy depths scatter more than the depths: without their errors τ is too small.
TEST(DepthErrors, RelaxationIsNotAttenuated) {
  CalibrationRequest request = depth_request(true);
  const PressRecording exact = exact_press(request, true);
  request.depth_error = 0;
  const Covered without = cover(request, exact, 5e-6);
  EXPECT_LT(without.mean.at("relaxation"), 0.95 * 0.02);
  EXPECT_EQ(without.estimated, 0);
  request.depth_error = 5e-6;
  const Covered with = cover(request, exact, 5e-6);
  EXPECT_NEAR(with.mean.at("relaxation"), 0.02, 0.03 * 0.02);
  EXPECT_GE(with.inside.at("relaxation"), 0.8 * kDepthRecordings);
  EXPECT_NEAR(with.mean.at("modulus"), 2e5, 0.02 * 2e5);
}

/// Exact depths of any motion are not taken for noisy ones.
TEST(DepthErrors, AMotionThatForcesFollowHasNone) {
  const CalibrationRequest request = depth_request(false);
  PressRecording r = exact_press(request, false);
  std::mt19937 random(3);
  add_noise(r.depth, 3e-5, random);  // a motion from place to place
  r.force = press_forces(request.scene({{"modulus", 2e5}}),
                         {.depth = r.depth, .rate = {}, .time = {}, .x = {}, .y = {}});
  add_noise(r.force, kCellNoise * *std::ranges::max_element(r.force), random);
  EXPECT_EQ(calibrate(request, r).depth_error.deviation, 0);
}

/// A ramp in and out whose depths are rounded to 10 um: σ = 10 um/√12.
TEST(DepthErrors, RoundedDepthsAreTold) {
  const CalibrationRequest request = depth_request(false);
  PressRecording r;
  for (int k = 0; k <= 60; ++k) r.depth.push_back(1e-4 + 1.337e-5 * (30 - std::abs(k - 30)));
  r.force = press_forces(request.scene({{"modulus", 2e5}}),
                         {.depth = r.depth, .rate = {}, .time = {}, .x = {}, .y = {}});
  for (double& d : r.depth) d = 1e-5 * std::round(d / 1e-5);
  std::mt19937 random(3);
  add_noise(r.force, 1e-3 * *std::ranges::max_element(r.force), random);
  const Calibration found = calibrate(request, r);
  EXPECT_TRUE(found.depth_error.estimated);
  EXPECT_NEAR(found.depth_error.deviation, 1e-5 / std::sqrt(12.0), 1e-6);
  EXPECT_GT(found.numbers[0].high, 2e5);
  EXPECT_LT(found.numbers[0].low, 2e5);
}

TEST(DepthErrors, FieldsHaveThemInTheirRows) {
  CalibrationRequest request = depth_request(false);
  request.depth_error = 1e-5;
  PressRecording r = exact_press(request, false);
  r.field =
      press_forces(request.scene({{"modulus", 2e5}}),
                   {.depth = r.depth, .rate = {}, .time = {}, .x = {}, .y = {}, .fields = true});
  r.points = r.field.size() / r.rows();
  EXPECT_THROW(calibrate(request, r), InputError);
}

}  // namespace
}  // namespace tangere
