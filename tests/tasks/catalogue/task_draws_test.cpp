// SPDX-License-Identifier: Apache-2.0
// Tests distributions that are not elementary: shares of a bar's weight, angles of fingers that may
// be drawn again, noise of readings.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/tasks/task_check.hpp"
#include "tests/tasks/task_starts.hpp"

namespace tangere {
namespace {

using testing::distance_from;
using testing::kDraws;
using testing::kUnlikely;
using testing::normal_distance;
using testing::OwnView;
using testing::Start;
using testing::starts;
using testing::task_named;

/// The probability that s/(s + t) < y, s and t of U(0.1, 1.1): s < kt, k = y/(1 - y).
double share_below(double y) {
  const double k = y / (1 - y);
  const double a = std::clamp(0.1 / k, 0.1, 1.1),
               b = std::clamp(1.1 / k, 0.1, 1.1);  // t where kt is 0.1, and 1.1
  return k * (b * b - a * a) / 2 - 0.1 * (b - a) + (1.1 - b);
}

/// Uses two blocks on the same side of the middle one. Their shares have the same distribution,
/// whatever the side weighs.
TEST(StableGrasp, BlocksOfASideShareItByChance) {
  std::vector<double> right, left;
  for (const Start& s : starts(*task_named("stable_grasp"))) {
    double moment = 0, sum = 0;
    for (std::size_t b = 0; b < s.varying.size(); ++b) {
      moment += s.varying[b] * (double(b) + 0.5);
      sum += s.varying[b];
    }
    const auto middle = std::size_t(moment / sum);
    if (middle >= 2) right.push_back(s.varying[0] / (s.varying[0] + s.varying[1]));
    if (middle <= 8) left.push_back(s.varying[10] / (s.varying[10] + s.varying[9]));
  }
  EXPECT_GT(std::min(right.size(), left.size()), kDraws * 8 / 10U);
  EXPECT_LT(distance_from(right, share_below), kUnlikely);
  EXPECT_LT(distance_from(left, share_below), kUnlikely);
  right.insert(right.end(), left.begin(), left.end());
  ASSERT_GT(right.size(), std::size_t(kDraws));
  EXPECT_LT(distance_from(right, share_below), kUnlikely);
}

/// Uses fingers whose tips are so far from the cap (50 mm or four deviations) that a redraw is
/// practically impossible. The cap alone decides that, so their angles follow the plain
/// distribution. (The distances of 1.9 million of them are below 0.85.)
TEST(CapOpening, AnglesFollowTheirDistributions) {
  const double mean[] = {0, -0.5, 0.8};
  const double out = 0.097 - 0.12 * std::sin(mean[1]) - 0.12 * std::sin(mean[1] + mean[2]);
  std::vector<double> angles[3];
  for (const Start& s : starts(*task_named("cap_opening")))
    for (std::size_t f = 0; f < 3; ++f) {
      const double turn = 2 * std::numbers::pi / 3 * double(f);
      const double gap =
          std::hypot(std::cos(turn) * out - s.varying[2], std::sin(turn) * out - s.varying[3]);
      if (gap - s.varying[1] - 0.012 < 0.05) continue;
      for (std::size_t k = 0; k < 3; ++k) angles[k].push_back(s.q[1 + 3 * f + k]);
    }
  for (std::size_t k = 0; k < 3; ++k) {
    ASSERT_GT(angles[k].size(), std::size_t(kDraws));
    EXPECT_LT(normal_distance(angles[k], mean[k], 0.05), kUnlikely) << k;
  }
}

/// A flow subtracts two readings, each with noise of 1e-5 N. One point with a shear of 1 N sets the
/// flow's scale to newtons.
TEST(Insertion, BothReadingsOfAFlowHaveNoise) {
  const auto task = task_named("insertion");
  OwnView own(*task);
  own.tactile[1][3 * 17] = 1;
  std::vector<double> o(task->spec().observation_size()), noise;
  for (own.actions = 0; own.actions < 20; ++own.actions) {
    task->observe(own.view(), o);
    for (std::size_t k = 0; k < o.size(); ++k)
      if (k != 17 && k != 130 + 17) noise.push_back(o[k]);
  }
  ASSERT_GT(noise.size(), std::size_t(kDraws));
  noise.resize(kDraws);
  double square = 0;
  for (const double n : noise) square += n * n / kDraws;
  const double deviation = std::sqrt(2.0) * 1e-5;
  EXPECT_NEAR(std::sqrt(square), deviation, 2.58 * deviation / std::sqrt(2.0 * kDraws));
  EXPECT_LT(normal_distance(noise, 0, deviation), kUnlikely);
}

TEST(Insertion, FlowBelowATenthOfAMillinewtonIsNone) {
  const auto task = task_named("insertion");
  OwnView own(*task);
  std::vector<double> o(task->spec().observation_size());
  own.tactile[1][3 * 17] = 4e-5;  // six deviations of noise below
  task->observe(own.view(), o);
  EXPECT_THAT(o, ::testing::Each(0.0));
  own.tactile[1][3 * 17] = 2e-4;
  task->observe(own.view(), o);
  EXPECT_NEAR(o[17], 1, 0.01);
}

}  // namespace
}  // namespace tangere
