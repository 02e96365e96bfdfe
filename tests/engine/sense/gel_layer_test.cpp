// SPDX-License-Identifier: Apache-2.0
// Tests the pressures of a coupled layer against its equations and closed forms (docs/layer.md).
// Lengths in mm, moduli in MPa.
#include "engine/layer/gel_layer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace tangere {
namespace {

using Numbers = std::vector<double>;

CompiledLayer layer_of(int cells, int side, double cell, double thickness, double poisson,
                       std::optional<double> margin = {}) {
  CompiledLayer layer;
  layer.side = side;
  layer.grid = {cells, cells, cell, cell, thickness, poisson, margin};
  const int points = cells * side;
  layer.weights = cell_weights(layer.grid, side, points, points);
  for (int i = 0; i < points * points; ++i)
    layer.cell_of_point.push_back(i / points / side * cells + i % points / side);
  layer.compliance = compile_layer(layer.grid);
  return layer;
}

/// Depths under a shape: f(x, y), from the middle of the pad.
template <class F>
Numbers depths(const CompiledLayer& layer, const F& f) {
  const int n = layer.grid.cols * layer.side;
  const double h = layer.grid.width / layer.side;
  Numbers out;
  for (int i = 0; i < n * n; ++i)
    out.push_back(f(h * (i % n + 0.5 - 0.5 * n), h * (i / n + 0.5 - 0.5 * n)));
  return out;
}

auto ball(double radius, double depth, double x0 = 0) {
  return [=](double x, double y) {
    const double square = (x - x0) * (x - x0) + y * y;
    return square < radius * radius ? std::sqrt(radius * radius - square) - radius + depth : 0.0;
  };
}

double force(const CompiledLayer& layer, const GelLayer& gel) {
  double sum = 0;
  for (const double p : gel.pressure()) sum += p;
  return sum * layer.grid.width * layer.grid.height / (layer.side * layer.side);
}

/// Largest violation of P = E k Σ max(0, δ - w)/m², w = C' P, and of P as the mean of p, relative
/// to the largest load.
double residual(const CompiledLayer& layer, const Numbers& depth, const GelLayer& gel, double E) {
  const auto cells = static_cast<std::size_t>(layer.grid.cells());
  const double whole = layer.side * layer.side;
  const Numbers load = gel.loads();
  Numbers found(cells), mean(cells), yield(cells);
  for (std::size_t i = 0; i < cells; ++i)
    for (std::size_t j = 0; j < cells; ++j)
      yield[i] += (layer.compliance.table[i * cells + j] - (i == j ? layer.compliance.own : 0)) *
                  load[j] / E;
  for (std::size_t s = 0; s < depth.size(); ++s) {
    const auto i = std::size_t(layer.cell_of_point[s]);
    if (depth[s] > 0)
      found[i] += E / layer.compliance.own * std::max(0.0, depth[s] - yield[i]) / whole;
    mean[i] += gel.pressure()[s] / whole;
  }
  double worst = 0, most = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    worst = std::max({worst, std::abs(found[i] - load[i]), std::abs(mean[i] - load[i])});
    most = std::max(most, load[i]);
  }
  return worst / most;
}

TEST(GelLayer, PressuresSolveItsEquations) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> depth(-0.3, 0.5);
  for (const auto margin : {std::optional<double>(), std::optional(0.4)})
    for (const int side : {1, 2, 3}) {
      const CompiledLayer layer = layer_of(9, side, 0.8, 4, 0.475, margin);
      GelLayer gel;
      for (int trial = 0; trial < 5; ++trial) {
        // Rough surfaces, whose contacts are islands.
        const Numbers rough = depths(layer, [&](double, double) { return depth(random); });
        gel.solve(layer, rough, 0.4);
        EXPECT_LT(residual(layer, rough, gel, 0.4), 1e-11) << side << " " << trial;
      }
      const Numbers smooth = depths(layer, ball(5, 0.7));
      gel.solve(layer, smooth, 0.4);
      EXPECT_LT(residual(layer, smooth, gel, 0.4), 1e-12);
      EXPECT_LE(gel.systems(), 5);
    }
}

TEST(GelLayer, PressureIsProportionalToTheModulus) {
  const CompiledLayer layer = layer_of(12, 2, 0.8, 4, 0.475);
  const Numbers depth = depths(layer, ball(5, 0.7));
  GelLayer one, two;
  one.solve(layer, depth, 0.4), two.solve(layer, depth, 0.8);
  for (std::size_t s = 0; s < depth.size(); ++s)
    EXPECT_NEAR(two.pressure()[s], 2 * one.pressure()[s], 1e-13);
}

/// Where all points press and a cell is a point, C p = δ whatever k.
TEST(GelLayer, AFullPressYieldsByItsDepth) {
  const CompiledLayer layer = layer_of(6, 1, 0.8, 4, 0.45, 0.0);
  const Numbers depth = depths(layer, [](double x, double y) { return 0.5 + 0.02 * x - 0.01 * y; });
  GelLayer gel;
  gel.solve(layer, depth, 0.4);
  for (std::size_t i = 0; i < 36; ++i) {
    EXPECT_GT(gel.pressure()[i], 0);
    double moved = 0;
    for (std::size_t j = 0; j < 36; ++j)
      moved += layer.compliance.table[36 * i + j] * gel.pressure()[j] / 0.4;
    EXPECT_NEAR(moved, depth[i], 1e-12);
  }
}

/// Points of larger cells have the pressures of points that are cells, not those of steps.
TEST(GelLayer, PressuresOfPointsAreSmoothInLargerCells) {
  const CompiledLayer fine = layer_of(24, 1, 0.375, 4, 0.475),
                      coarse = layer_of(12, 2, 0.75, 4, 0.475);
  GelLayer a, b;
  a.solve(fine, depths(fine, ball(7.5, 0.5)), 0.428);
  b.solve(coarse, depths(coarse, ball(7.5, 0.5)), 0.428);
  double off = 0, square = 0;
  for (std::size_t s = 0; s < a.pressure().size(); ++s) {
    off += std::pow(a.pressure()[s] - b.pressure()[s], 2);
    square += std::pow(a.pressure()[s], 2);
  }
  EXPECT_LT(std::sqrt(off / square), 0.1);
}

/// Hertz with the correction for a bonded layer: 4/3 E/(1 - ν²) √R d^1.5 (1 + 1.13 χ).
TEST(GelLayer, AThickLayerUnderABallIsThatOfHertz) {
  const double R = 7.5, d = 0.3, nu = 0.45, t = 60, chi = std::sqrt(R * d) / t;
  const CompiledLayer layer = layer_of(14, 2, std::sqrt(R * d) / 4, t, nu);
  GelLayer gel;
  gel.solve(layer, depths(layer, ball(R, d)), 1);
  const double hertz = 4.0 / 3 / (1 - nu * nu) * std::sqrt(R) * std::pow(d, 1.5) * (1 + 1.13 * chi);
  EXPECT_NEAR(force(layer, gel) / hertz, 1, 0.03);
}

/// A thin compressible layer is a bed of springs: π M/t (R d² - d³/3).
TEST(GelLayer, AThinCompressibleLayerIsABedOfSprings) {
  const double R = 7.5, d = 0.05, nu = 0.3, t = 0.2;
  const CompiledLayer layer = layer_of(40, 1, 0.05, t, nu);
  GelLayer gel;
  gel.solve(layer, depths(layer, ball(R, d)), 1);
  const double M = (1 - nu) / ((1 + nu) * (1 - 2 * nu));
  EXPECT_NEAR(force(layer, gel) / (std::numbers::pi * M / t * (R * d * d - d * d * d / 3)), 1,
              0.03);
}

TEST(GelLayer, ForcesOfBodiesFarApartAddUp) {
  const CompiledLayer layer = layer_of(24, 1, 0.8, 1.5, 0.475);
  GelLayer left, right, both;
  left.solve(layer, depths(layer, ball(4, 0.3, -6)), 1);
  right.solve(layer, depths(layer, ball(4, 0.3, 6)), 1);
  both.solve(layer,
             depths(layer,
                    [](double x, double y) {
                      return std::max(ball(4, 0.3, -6)(x, y), ball(4, 0.3, 6)(x, y));
                    }),
             1);
  EXPECT_NEAR(force(layer, both) / (force(layer, left) + force(layer, right)), 1, 0.01);
}

TEST(GelLayer, DeeperIsHarderEverywhereUnderABall) {
  const CompiledLayer layer = layer_of(16, 2, 0.8, 4, 0.475);
  GelLayer gel;
  double before = 0;
  for (double d = 0.1; d < 1.5; d += 0.1) {
    gel.solve(layer, depths(layer, ball(7.5, d)), 0.4);
    EXPECT_GT(force(layer, gel), before);
    before = force(layer, gel);
  }
}

/// Nothing, one point, and no more.
TEST(GelLayer, SmallContacts) {
  const CompiledLayer layer = layer_of(5, 2, 0.8, 4, 0.475);
  Numbers depth(100);
  GelLayer gel;
  gel.solve(layer, depth, 1);
  EXPECT_EQ(force(layer, gel), 0);
  EXPECT_EQ(gel.systems(), 0);
  depth[44] = 0.1;
  gel.solve(layer, depth, 1);
  EXPECT_LT(residual(layer, depth, gel, 1), 1e-13);
  EXPECT_GT(gel.pressure()[44], 0);
}

/// Relaxation alone finds the pressures of Newton's method. At a limit the layer is unsolved.
TEST(GelLayer, SaysWhetherItIsSolved) {
  CompiledLayer layer = layer_of(9, 2, 0.8, 4, 0.475, 0.4);
  const Numbers depth = depths(layer, ball(5, 0.7));
  GelLayer newton, relaxed;
  newton.solve(layer, depth, 0.4);
  EXPECT_TRUE(newton.solved());
  layer.most_systems = 0;
  relaxed.solve(layer, depth, 0.4);
  EXPECT_TRUE(relaxed.solved());
  EXPECT_EQ(relaxed.systems(), 1) << "the last, of what presses after it";
  for (std::size_t s = 0; s < depth.size(); ++s)
    EXPECT_NEAR(relaxed.pressure()[s], newton.pressure()[s], 1e-9) << s;
  layer.most_sweeps = 2;
  relaxed.solve(layer, depth, 0.4);
  EXPECT_FALSE(relaxed.solved());
  relaxed.solve(layer, Numbers(depth.size()), 0.4);
  EXPECT_TRUE(relaxed.solved()) << "nothing presses";
}

/// A solver that goes on from its last solution has the bits of one that begins anew, and needs
/// fewer systems.
TEST(GelLayer, TheLastSolutionDoesNotMatterToTheBits) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  for (const bool feedback : {false, true})
    for (const int side : {1, 2}) {
      CompiledLayer layer = layer_of(14, side, 0.8, 4, 0.475, 0.4);
      layer.number = 1;
      layer.feedback = feedback;
      GelLayer kept;
      int warm = 0, cold = 0;
      double x = 0, depth = 0.6;
      for (int step = 0; step < 60; ++step) {
        // Mostly a slow slide, now and then a leap, a lift, or a flat body.
        x = step % 13 == 12 ? 2 * normal(random) : x + 0.01 * normal(random);
        depth = step % 17 == 16 ? -0.1 : 0.6 + 0.01 * normal(random);
        const Numbers depths_now =
            step % 19 == 18 ? depths(layer, [&](double u, double) { return u < 2 ? 0.2 : 0.0; })
                            : depths(layer, ball(5, depth, x));
        GelLayer fresh;
        kept.solve(layer, depths_now, 0.4);
        fresh.solve(layer, depths_now, 0.4);
        warm += kept.systems(), cold += fresh.systems();
        ASSERT_TRUE(kept.solved());
        for (std::size_t s = 0; s < depths_now.size(); ++s)
          ASSERT_EQ(kept.pressure()[s], fresh.pressure()[s]) << side << ' ' << step << ' ' << s;
      }
      EXPECT_LT(warm, cold) << side;
    }
}

TEST(GelLayer, DerivativesAgreeWithDifferences) {
  const CompiledLayer layer = layer_of(10, 2, 0.8, 4, 0.475, 0.4);
  const Numbers depth = depths(layer, ball(5, 0.7));
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Numbers bar, dot;
  for (std::size_t s = 0; s < depth.size(); ++s)
    bar.push_back(normal(random)), dot.push_back(normal(random));
  GelLayer gel;
  gel.solve(layer, depth, 0.4);
  Numbers depth_bar(depth.size()), pressure_dot(depth.size());
  gel.pull_back(bar, depth_bar);
  gel.push_forward(dot, {}, pressure_dot);
  double forward = 0, back = 0, size = 0;
  for (std::size_t s = 0; s < depth.size(); ++s) {
    forward += bar[s] * pressure_dot[s];
    back += depth_bar[s] * dot[s];
    size += std::abs(bar[s] * pressure_dot[s]);
  }
  EXPECT_NEAR(forward, back, 1e-12 * size);
  const double e = 1e-7;
  const auto moved = [&](double by) {
    Numbers other = depth;
    for (std::size_t s = 0; s < depth.size(); ++s) other[s] += depth[s] > 0 ? by * dot[s] : 0;
    GelLayer there;
    there.solve(layer, other, 0.4);
    return Numbers(there.pressure().begin(), there.pressure().end());
  };
  const Numbers up = moved(e), down = moved(-e);
  for (std::size_t s = 0; s < depth.size(); ++s)
    if (gel.pressure()[s] > 1e-3) {
      EXPECT_NEAR((up[s] - down[s]) / (2 * e), pressure_dot[s], 1e-6) << s;
    }
}

/// By t and ν, of a reading and of a contact. Depths are in units of which t is 4.
TEST(GelLayer, DerivativesByTheMaterialAgreeWithDifferences) {
  for (const bool feedback : {false, true})
    for (const LayerMaterial dot : {LayerMaterial{1, 0}, LayerMaterial{0, 1}}) {
      const auto made = [&](double e) {
        CompiledLayer layer =
            layer_of(10, 2, 0.8, 4.1 + e * dot.thickness, 0.45 + e * dot.poisson, 0.4);
        layer.feedback = feedback;
        return layer;
      };
      const CompiledLayer layer = made(0);
      const Numbers depth = depths(layer, ball(5, 0.7)), still(depth.size());
      const auto pressures = [&](double e) {
        GelLayer there;
        there.solve(made(e), depth, 0.4);
        return Numbers(there.pressure().begin(), there.pressure().end());
      };
      GelLayer gel;
      gel.solve(layer, depth, 0.4);
      Numbers bar, depth_bar(depth.size()), change(depth.size());
      std::mt19937_64 random(3);
      std::normal_distribution<double> normal;
      for (std::size_t s = 0; s < depth.size(); ++s) bar.push_back(normal(random));
      gel.push_forward(still, dot, change);
      gel.pull_back(bar, depth_bar);
      const LayerMaterial back = gel.pull_back_material(bar);
      double forward = 0, size = 0, largest = 0;
      for (std::size_t s = 0; s < depth.size(); ++s) {
        forward += bar[s] * change[s];
        size += std::abs(bar[s] * change[s]);
        largest = std::max(largest, std::abs(change[s]));
      }
      EXPECT_GT(largest, 1e-3);
      EXPECT_NEAR(forward, dot.thickness * back.thickness + dot.poisson * back.poisson,
                  1e-12 * size);
      const double e = 1e-6;
      const Numbers up = pressures(e), down = pressures(-e);
      for (std::size_t s = 0; s < depth.size(); ++s)
        if (gel.pressure()[s] > 1e-3) {
          EXPECT_NEAR((up[s] - down[s]) / (2 * e), change[s], 1e-7 * largest) << s;
        }
    }
}

}  // namespace
}  // namespace tangere
