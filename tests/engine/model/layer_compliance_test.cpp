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
    EXPECT_NEAR(layer_compliance(4, nu, 0).normal, 4 / M, 1e-12 / M);
    // and is continuous there
    EXPECT_NEAR(layer_compliance(4, nu, 1e-4).normal, 4 / M, 2e-3 / M) << nu;
  }
}

/// Uniform shear τ moves it by τ t/G along itself.
TEST(LayerCompliance, UniformShearShearsTheLayer) {
  const double G = 1 / (2 * 1.45);
  for (const double k : {0.0, 1e-5}) {
    const WaveCompliance c = layer_compliance(4, 0.45, k);
    EXPECT_NEAR(c.across * G / 4, 1, 1e-8);
    EXPECT_NEAR(c.along * G / 4, 1, 1e-8);
    EXPECT_NEAR(c.coupling, 0, 1e-3);
  }
}

/// Waves much shorter than the thickness, of a half-space: 2 (1 - ν²)/(E k) by pressure and by
/// shear along them, 1/(G k) by shear across them, and -(1 - 2ν)/(2 G k) of coupling.
TEST(LayerCompliance, ShortWavesDoNotReachTheBack) {
  const double nu = 0.475, G = 1 / (2 * (1 + nu));
  const WaveCompliance c = layer_compliance(4, nu, 50);
  EXPECT_NEAR(c.normal * 50, 2 * (1 - nu * nu), 1e-12);
  EXPECT_NEAR(c.along * 50, 2 * (1 - nu * nu), 1e-12);
  EXPECT_NEAR(c.across * 50, 1 / G, 1e-12);
  EXPECT_NEAR(c.coupling * 50, -(1 - 2 * nu) / (2 * G), 1e-12);
}

/// Of an incompressible layer and long waves: k² t³/(3 G), and k t²/(2 G) of coupling.
TEST(LayerCompliance, LongWavesOfAnIncompressibleLayer) {
  const double nu = 0.5 - 1e-9, G = 1 / (2 * (1 + nu)), t = 2, k = 1e-2;
  const WaveCompliance c = layer_compliance(t, nu, k);
  EXPECT_NEAR(c.normal / (k * k * t * t * t / (3 * G)), 1, 5e-3);
  EXPECT_NEAR(c.coupling / (k * t * t / (2 * G)), 1, 5e-3);
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

/// Pressure beside a free side pushes the gel out there: a press far from it, in cells, moves the
/// surface at the side less than in a gel without sides, in which it bulges. Far from the sides
/// nothing changes.
TEST(LayerCompliance, SidesMatterNearThem) {
  LayerGrid g = grid(20, 0.8, 2, 0.475);
  const LayerCompliance none = compile_layer(g);
  g.margin = 0.0;
  const LayerCompliance sides = compile_layer(g);
  const auto at = [](const LayerCompliance& c, std::size_t i, std::size_t j) {
    return c.table[400 * i + j];
  };
  const std::size_t side = 10 * 20, beside = side + 5, middle = side + 10;
  EXPECT_LT(at(none, side, beside), 0);
  EXPECT_LT(std::abs(at(sides, side, beside)), 0.5 * std::abs(at(none, side, beside)));
  EXPECT_NEAR(at(sides, middle, middle) / at(none, middle, middle), 1, 1e-3);
  g.margin = 12.0;  // far away
  const LayerCompliance far = compile_layer(g);
  EXPECT_NEAR(at(far, 0, 0) / at(none, 0, 0), 1, 1e-3);
}

/// Loads do work, with sides and without, so that pressures are unique: xᵀ C x > 0.
TEST(LayerCompliance, IsPositiveDefinite) {
  LayerGrid g{6, 7, 0.8, 0.6, 3, 0.49};
  for (const auto margin : {std::optional<double>(), std::optional(0.0), std::optional(0.7)}) {
    g.margin = margin;
    std::vector<double> c = compile_layer(g).table;
    for (std::size_t i = 0; i < 42; ++i) {  // Cholesky
      ASSERT_GT(c[43 * i], 1e-6 * c[0]) << i;
      for (std::size_t j = i + 1; j < 42; ++j)
        for (std::size_t k = i + 1; k < 42; ++k)
          c[42 * j + k] -= c[42 * j + i] * c[42 * i + k] / c[43 * i];
    }
  }
}

}  // namespace
}  // namespace tangere
