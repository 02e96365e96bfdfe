// SPDX-License-Identifier: Apache-2.0
// Tests the compliance of a bonded elastic layer against closed forms (docs/layer.md).
#include "engine/model/layer_compliance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tangere {
namespace {

/// Lengths in mm, moduli in MPa: E = 1 gives mm/MPa.
LayerGrid grid(int n, double cell, double thickness, double poisson) {
  return {n, n, cell, cell, thickness, poisson};
}

/// From an independent program: cells of 0.75 mm, t = 4 mm, ν = 0.475, G = 0.145 MPa, a box of 96 ×
/// 96 cells.
TEST(LayerCompliance, ATableThatAnotherProgramMade) {
  const LayerCompliance c = compile_layer(grid(20, 0.75, 4, 0.475));
  const double E = 2 * (1 + 0.475) * 0.145;
  const auto at = [&](int row, int col) { return c.table[std::size_t(20 * row + col)] / E; };
  EXPECT_NEAR(at(0, 0), 1.145185, 5e-6);
  EXPECT_NEAR(at(1, 0), 0.347684, 5e-6);
  EXPECT_NEAR(at(1, 1), 0.192258, 5e-6);
  EXPECT_NEAR(at(0, 4), 0.003975, 5e-6);
  EXPECT_NEAR(at(8, 0), -0.006856, 5e-6);
  EXPECT_EQ(c.own, c.table[0]);
}

/// A thick layer is a half-space: (1 - ν²)/(π E r) 𝒜 far from a cell. The box repeats itself, so
/// that the mean over it is missing, and differences are compared.
TEST(LayerCompliance, AThickLayerIsAHalfSpaceFarAway) {
  const LayerCompliance c = compile_layer(grid(10, 1, 60, 0.3));
  const auto boussinesq = [](double r) { return (1 - 0.3 * 0.3) / (std::numbers::pi * r); };
  for (const int r : {4, 6})
    EXPECT_NEAR((c.table[std::size_t(r)] - c.table[9]) / (boussinesq(r) - boussinesq(9)), 1, 0.02)
        << r;
}

/// Uniform pressure moves the surface by p t/M, M = E (1 - ν)/((1 + ν)(1 - 2ν)).
TEST(LayerCompliance, UniformPressureCompressesTheLayer) {
  for (const double nu : {0.0, 0.3, 0.475}) {
    const double M = (1 - nu) / ((1 + nu) * (1 - 2 * nu));
    EXPECT_NEAR(layer_compliance(4, nu, 0), 4 / M, 1e-12 / M);
    EXPECT_NEAR(layer_compliance(4, nu, 1e-4), 4 / M, 2e-3 / M) << nu;  // and is continuous there
  }
}

/// Waves much shorter than the thickness: 2 (1 - ν²)/(E k).
TEST(LayerCompliance, ShortWavesDoNotReachTheBack) {
  EXPECT_NEAR(layer_compliance(4, 0.475, 50) * 50, 2 * (1 - 0.475 * 0.475), 1e-12);
}

TEST(LayerCompliance, PressureHereAndDisplacementThereAreReciprocal) {
  LayerGrid g{5, 7, 0.8, 0.6, 3, 0.45};
  for (const auto margin : {std::optional<double>(), std::optional(0.0), std::optional(1.2)}) {
    g.margin = margin;
    const LayerCompliance c = compile_layer(g);
    for (std::size_t i = 0; i < 35; ++i)
      for (std::size_t j = 0; j < i; ++j) EXPECT_EQ(c.table[35 * i + j], c.table[35 * j + i]);
  }
}

/// A free side lets cells beside it yield more, to pressure on them and on their neighbours; far
/// from the sides nothing changes.
TEST(LayerCompliance, SidesAreMirrors) {
  LayerGrid g = grid(20, 0.8, 2, 0.475);
  const LayerCompliance none = compile_layer(g);
  g.margin = 0.0;
  const LayerCompliance sides = compile_layer(g);
  const std::size_t corner = 0, middle = 10 * 20 + 10;
  const auto own = [](const LayerCompliance& c, std::size_t i) { return c.table[401 * i]; };
  EXPECT_GT(own(sides, corner), 1.5 * own(none, corner));
  EXPECT_NEAR(own(sides, middle) / own(none, middle), 1, 1e-3);
  g.margin = 12.0;  // far away
  const LayerCompliance far = compile_layer(g);
  EXPECT_NEAR(own(far, corner) / own(none, corner), 1, 1e-3);
}

}  // namespace
}  // namespace tangere
