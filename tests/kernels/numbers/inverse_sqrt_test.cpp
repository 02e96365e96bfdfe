// SPDX-License-Identifier: Apache-2.0
// Tests arithmetic of lanes on every instruction set against the standard library.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "kernels/numbers/inverse_sqrt.hpp"
#include "tests/kernels/lane_probe.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using testing::LaneProbe;

bool fuses(const LaneProbe& p) { return std::strncmp(p.name, "avx", 3) == 0; }

/// A number of each binade in turn, ends included.
double positive(testing::Random& random, int n) {
  const int exponent = -1022 + n % 2046;
  const double mantissa = n < 2046   ? 1.0
                          : n < 4092 ? std::nextafter(2.0, 1.0)
                                     : random.uniform(1, 2);
  return std::ldexp(mantissa, exponent);
}

TEST(InverseSqrt, IsOneOverTheRootOverTheWholeRange) {
  double worst = 0;
  for (const LaneProbe* probe : testing::lane_probes()) {
    SCOPED_TRACE(probe->name);
    testing::Random random(7);
    for (int n = 0; n < 8 * 40960; n += 8) {
      alignas(64) double x[8], y[8];
      for (int l = 0; l < 8; ++l) x[l] = positive(random, n + l);
      probe->inverse_sqrt(x, y);
      for (int l = 0; l < 8; ++l) {
        const long double exact = 1 / std::sqrt(static_cast<long double>(x[l]));
        const auto error = static_cast<double>(std::abs((y[l] - exact) / exact));
        worst = std::max(worst, error);
        ASSERT_LE(error, 4e-16) << x[l];
        ASSERT_NEAR(kernels::inverse_sqrt(x[l]) / static_cast<double>(exact), 1, 4e-16);
      }
    }
  }
  RecordProperty("worst_relative_error", std::to_string(worst * 1e16) + "e-16");
}

TEST(InverseSqrt, HasTheSameBitsWhereProductsAreFused) {
  testing::Random random(8);
  for (int n = 0; n < 20000; ++n) {
    alignas(64) double x[8], first[8], y[8];
    for (int l = 0; l < 8; ++l) x[l] = positive(random, 5000 + 8 * n + l);
    bool have = false;
    for (const LaneProbe* probe : testing::lane_probes()) {
      if (!fuses(*probe)) continue;
      probe->inverse_sqrt(x, y);
      if (!have) std::memcpy(first, y, sizeof y);
      have = true;
      ASSERT_EQ(std::memcmp(first, y, sizeof y), 0) << probe->name;
    }
  }
}

TEST(InverseSqrt, LanesDoNotMeet) {
  for (const LaneProbe* probe : testing::lane_probes()) {
    SCOPED_TRACE(probe->name);
    alignas(64) double x[8] = {1, 2, 3, 4, 5, 6, 7, 8}, clean[8], y[8];
    probe->inverse_sqrt(x, clean);
    x[0] = std::numeric_limits<double>::quiet_NaN(), x[3] = 0, x[6] = -1,
    x[7] = std::numeric_limits<double>::infinity();
    probe->inverse_sqrt(x, y);
    for (const int l : {1, 2, 4, 5}) EXPECT_EQ(y[l], clean[l]);
  }
}

}  // namespace
}  // namespace tangere
