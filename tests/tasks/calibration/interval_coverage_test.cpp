// SPDX-License-Identifier: Apache-2.0
// Of many recordings with noise of their own, the 95 % intervals of nearly all contain the numbers
// that made them.
#include <gtest/gtest.h>

#include <map>

#include "tests/tasks/calibration/gel_press.hpp"

namespace tangere {
namespace {

using testing::add_noise;
using testing::gel_press;

constexpr double kCovered = 0.85;  // of the recordings

/// In by 0.36 mm and out, at 4 mm/s.
PressRecording gel_path() {
  PressRecording out;
  for (int k = 0; k < 19; ++k) {
    out.time.push_back(1e-2 * k);
    out.depth.push_back(4e-5 * (k <= 9 ? k : 18 - k));
  }
  return out;
}

/// Forces of a layer with relaxation jump where a point begins to be touched at a speed.
TEST(IntervalCoverage, IsThatOfALayerWithRelaxation) {
  constexpr int kRecordings = 30;
  constexpr double kNoise = 0.003;  // of the peak
  const SkinNumbers truth{{"modulus", 2e5}, {"relaxation", 0.02}, {"zero", 2.3e-5}};
  CalibrationRequest request;
  request.scene = [](const SkinNumbers& numbers) { return gel_press(numbers, true); };
  request.start = {{"modulus", 1e5}, {"relaxation", 5e-3}};
  PressRecording r = gel_path();
  std::vector<double> depth = r.depth;
  for (double& d : depth) d += truth.at("zero");
  const std::vector<double> rate = r.rates();
  const std::vector<double> exact = press_forces(
      request.scene(truth), {.depth = depth, .rate = rate, .time = {}, .x = {}, .y = {}});
  std::map<std::string, int> inside;
  std::mt19937 random(7);
  for (int k = 0; k < kRecordings; ++k) {
    r.force = exact;
    add_noise(r.force, kNoise * *std::ranges::max_element(exact), random);
    for (const FittedNumber& x : calibrate(request, r).numbers)
      inside[x.name] += truth.at(x.name) >= x.low && truth.at(x.name) <= x.high;
  }
  ASSERT_EQ(inside.size(), truth.size());
  for (const auto& [name, count] : inside) EXPECT_GE(count, kCovered * kRecordings) << name;
}

}  // namespace
}  // namespace tangere
