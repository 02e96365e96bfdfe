// SPDX-License-Identifier: Apache-2.0
// Tests how the surface of a layer moves under tractions, against numbers of another program and
// identities (docs/layer.md). Lengths in mm, moduli in MPa.
#include "engine/model/surface_compliance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tangere {
namespace {

using Numbers = std::vector<double>;

/// u by a unit traction along b on one cell.
Numbers unit_response(const SurfaceCompliance& c, std::size_t cells, std::size_t b,
                      std::size_t cell) {
  Numbers q(3 * cells), u(3 * cells);
  q[b * cells + cell] = 1;
  c.displace(q, u);
  return u;
}

/// From an independent program, as in layer_compliance_test.cpp. It leaves out the mean over the
/// box of a shear's displacement, so differences are compared.
TEST(SurfaceCompliance, ATableThatAnotherProgramMade) {
  const SurfaceCompliance c({16, 16, 0.75, 0.75, 4, 0.475});
  const double E = 2 * (1 + 0.475) * 0.145;
  const std::size_t cells = 256, middle = 7 * 16 + 7;
  const Numbers by_shear = unit_response(c, cells, 0, middle),
                by_press = unit_response(c, cells, 2, middle);
  const double own = by_shear[middle] / E;
  EXPECT_NEAR(own - by_shear[middle + 16] / E, 1.776845 - 0.746658, 5e-6);
  EXPECT_NEAR(own - by_shear[middle + 17] / E, 1.776845 - 0.387461, 5e-6);
  EXPECT_NEAR(own - by_shear[middle + 8 * 16] / E, 1.776845 - 0.044595, 5e-6);
  EXPECT_NEAR(by_press[middle + 16] / E, 0.012646, 5e-6);
  EXPECT_NEAR(by_press[middle + 4 * 16] / E, -0.015976, 5e-6);
  EXPECT_NEAR(by_press[middle - 4 * 16] / E, 0.015976, 5e-6);
  EXPECT_NEAR(by_press[2 * cells + middle] / E, 1.145185, 5e-6);
}

/// C_ab(i, j) = C_ba(j, i), with sides and without.
TEST(SurfaceCompliance, IsReciprocal) {
  LayerGrid g{5, 4, 0.8, 0.6, 3, 0.45};
  const std::size_t n = 20;
  for (const auto margin : {std::optional<double>(), std::optional(0.0), std::optional(1.2)}) {
    g.margin = margin;
    const SurfaceCompliance c(g);
    std::vector<Numbers> columns;
    for (std::size_t k = 0; k < 3 * n; ++k) columns.push_back(unit_response(c, n, k / n, k % n));
    for (std::size_t i = 0; i < 3 * n; ++i)
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_NEAR(columns[i][j], columns[j][i], 1e-13) << i << " " << j;
  }
}

/// Its normal part is that by which pressures are solved.
TEST(SurfaceCompliance, PressesAsTheLayerDoes) {
  LayerGrid g{5, 4, 0.8, 0.6, 3, 0.45};
  for (const auto margin : {std::optional<double>(), std::optional(0.5)}) {
    g.margin = margin;
    const SurfaceCompliance c(g);
    const LayerCompliance layer = compile_layer(g);
    for (std::size_t j = 0; j < 20; ++j) {
      const Numbers u = unit_response(c, 20, 2, j);
      for (std::size_t i = 0; i < 20; ++i) EXPECT_NEAR(u[40 + i], layer.table[20 * i + j], 1e-13);
    }
  }
}

/// Turning the grid by 90° turns the motion.
TEST(SurfaceCompliance, HasNoPreferredAxis) {
  LayerGrid g{5, 4, 0.8, 0.6, 3, 0.45, 0.5}, turned{4, 5, 0.6, 0.8, 3, 0.45, 0.5};
  const Numbers u = unit_response(SurfaceCompliance(g), 20, 0, 1 * 4 + 2),
                v = unit_response(SurfaceCompliance(turned), 20, 1, 2 * 5 + 1);
  for (std::size_t i = 0; i < 5; ++i)
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_NEAR(u[4 * i + j], v[20 + 5 * j + i], 1e-13);
      EXPECT_NEAR(u[20 + 4 * i + j], v[5 * j + i], 1e-13);
      EXPECT_NEAR(u[40 + 4 * i + j], v[40 + 5 * j + i], 1e-13);
    }
}

TEST(SurfaceCompliance, PullsBackByItsTranspose) {
  const SurfaceCompliance c({5, 4, 0.8, 0.6, 3, 0.45, 0.5});
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Numbers q(60), bar(60), u(60), q_bar(60);
  for (double& x : bar) x = normal(random);
  for (const std::size_t cell : {3u, 7u, 8u})
    for (std::size_t b = 0; b < 3; ++b) q[20 * b + cell] = normal(random);
  c.displace(q, u);
  c.pull_back(q, bar, q_bar);
  double one = 0, two = 0;
  for (std::size_t k = 0; k < 60; ++k) one += bar[k] * u[k], two += q_bar[k] * q[k];
  EXPECT_NEAR(one, two, 1e-12 * std::abs(one));
  EXPECT_EQ(q_bar[0], 0);  // a cell without traction
}

}  // namespace
}  // namespace tangere
