// SPDX-License-Identifier: Apache-2.0
// Tests interpolation that never falls.
#include "engine/model/monotone_cubic.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace tangere {
namespace {

using Numbers = std::vector<double>;

const Numbers kX = {0, 0.5, 1, 1.5, 4, 5}, kY = {0, 0.1, 3, 3, 3.5, 9};

TEST(MonotoneCubic, GoesThroughTheTableAndNeverFalls) {
  const MonotoneCubic cubic(kX, kY);
  for (std::size_t k = 0; k < kX.size(); ++k) EXPECT_NEAR(cubic.at(kX[k]).value, kY[k], 1e-14);
  double before = 0;
  for (int k = 0; k <= 7000; ++k) {
    const auto [value, slope] = cubic.at(1e-3 * k);
    EXPECT_GE(value, before - 1e-14) << k;
    EXPECT_GE(slope, 0) << k;
    before = value;
  }
  EXPECT_EQ(cubic.at(1.2).value, 3) << "a plateau stays one";
}

TEST(MonotoneCubic, ItsSlopeIsContinuousAndThatOfItsValues) {
  const MonotoneCubic cubic(kX, kY);
  constexpr double kStep = 1e-6;
  for (double x = kStep; x < 6; x += 0.0101) {
    const double slope = (cubic.at(x + kStep).value - cubic.at(x - kStep).value) / (2 * kStep);
    EXPECT_NEAR(slope, cubic.at(x).slope, 1e-4) << x;
  }
  for (std::size_t k = 1; k < kX.size(); ++k)
    EXPECT_NEAR(cubic.at(kX[k] - 1e-9).slope, cubic.at(kX[k] + 1e-9).slope, 1e-6) << k;
}

TEST(MonotoneCubic, LinesStayLinesAlsoBeyondTheEnd) {
  for (const MonotoneCubic& line :
       {MonotoneCubic({0, 2}, {0, 6}), MonotoneCubic({0, 0.1, 0.7, 2}, {0, 0.3, 2.1, 6})})
    for (const double x : {0.0, 0.05, 0.5, 1.9, 2.0, 3.0, 10.0}) {
      EXPECT_NEAR(line.at(x).value, 3 * x, 1e-13);
      EXPECT_NEAR(line.at(x).slope, 3, 1e-13);
    }
}

/// Smooth functions are met to the third order of the intervals.
TEST(MonotoneCubic, ConvergesToASmoothFunction) {
  const auto error = [](int n) {
    Numbers x, y;
    for (int k = 0; k <= n; ++k) x.push_back(1.0 * k / n), y.push_back(std::expm1(x.back()));
    const MonotoneCubic cubic(x, y);
    double most = 0;
    for (double at = 0.2; at < 0.8; at += 1e-3)
      most = std::max(most, std::abs(cubic.at(at).value - std::expm1(at)));
    return most;
  };
  EXPECT_LT(error(40) / error(20), 1 / 6.0);
  EXPECT_LT(error(20), 1e-5);
}

}  // namespace
}  // namespace tangere
