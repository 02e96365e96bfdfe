// SPDX-License-Identifier: Apache-2.0
// Sums of products against the general sums of the same points, for contacts with friction's spring
// and without.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "kernels/contact/pair_contact.hpp"

namespace tangere::testing {

/// `finished`: of product sums with derivatives, `values`: of those without.
inline void expect_finished_sums(const kernels::PairSums<double>& finished,
                                 const kernels::PairSums<double>& values,
                                 const kernels::PairSums<double>& general, double tolerance) {
  const auto close = [&](const double* a, const double* b, int count) {
    double scale = 1e-300;
    for (int i = 0; i < count; ++i) scale = std::max(scale, std::abs(b[i]));
    for (int i = 0; i < count; ++i) EXPECT_NEAR(a[i], b[i], tolerance * scale) << i;
  };
  close(&finished.wrench.l.x, &general.wrench.l.x, 3);
  close(&finished.wrench.a.x, &general.wrench.a.x, 3);
  EXPECT_EQ(values.wrench.l.x, finished.wrench.l.x);
  EXPECT_EQ(values.wrench.a.z, finished.wrench.a.z);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      SCOPED_TRACE(std::to_string(i) + std::to_string(j));
      close(&finished.k[i][j].m[0][0], &general.k[i][j].m[0][0], 9);
      close(&finished.d[i][j].m[0][0], &general.d[i][j].m[0][0], 9);
    }
}

}  // namespace tangere::testing
