// SPDX-License-Identifier: Apache-2.0
// Compares the membrane over a body with its closed forms, and its pullback with differences.
#include "engine/picture/membrane.hpp"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using Numbers = std::vector<double>;
constexpr double kDistance = 1e-4, kDentReach = 5e-4, kBallRadius = 4e-3;  // [m]

struct Grid {
  int rows, cols;
  [[nodiscard]] double x(int col) const { return (col - (cols - 1) / 2) * kDistance; }
  [[nodiscard]] double y(int row) const { return (row - (rows - 1) / 2) * kDistance; }
  [[nodiscard]] std::size_t size() const { return std::size_t(rows) * std::size_t(cols); }
};

/// Depth of a round body of radius R whose lowest point is `deepest` below the surface.
double round_depth(double distance, double deepest) {
  const double square = kBallRadius * kBallRadius - distance * distance;
  return square > 0 ? std::max(0.0, deepest - kBallRadius + std::sqrt(square)) : 0;
}

template <class F>
Numbers on(const Grid& grid, const F& f) {
  Numbers numbers;
  for (int i = 0; i < grid.rows; ++i)
    for (int j = 0; j < grid.cols; ++j) numbers.push_back(f(grid.x(j), grid.y(i)));
  return numbers;
}

Numbers settled(const Grid& grid, const Numbers& depth) {
  Membrane<double> membrane(grid.rows, grid.cols, kDentReach / kDistance, kDentReach / kDistance);
  Numbers height(grid.size());
  membrane.settle(depth, height);
  return height;
}

TEST(Membrane, FallsExponentiallyBesideACylinder) {
  const Grid grid{101, 161};
  const double a = 1.2e-3, at_edge = kDentReach * a / std::sqrt(kBallRadius * kBallRadius - a * a),
               deepest = at_edge + kBallRadius - std::sqrt(kBallRadius * kBallRadius - a * a);
  const Numbers height =
      settled(grid, on(grid, [&](double x, double) { return round_depth(x, deepest); }));
  for (int j = 0; j < grid.cols; ++j) {
    const double x = std::abs(grid.x(j)), expected = x > a
                                                         ? at_edge * std::exp(-(x - a) / kDentReach)
                                                         : round_depth(x, deepest);
    EXPECT_NEAR(height[std::size_t(50 * grid.cols + j)], expected, 1e-3 * deepest) << "x " << x;
  }
}

TEST(Membrane, FallsAsABesselFunctionBesideABall) {
  const Grid grid{161, 161};
  const double a = 1.2e-3, t = a / kDentReach,
               at_edge = kDentReach * std::cyl_bessel_k(0.0, t) / std::cyl_bessel_k(1.0, t) * a /
                         std::sqrt(kBallRadius * kBallRadius - a * a),
               deepest = at_edge + kBallRadius - std::sqrt(kBallRadius * kBallRadius - a * a);
  const Numbers height = settled(
      grid, on(grid, [&](double x, double y) { return round_depth(std::hypot(x, y), deepest); }));
  for (int j = 0; j < grid.cols; ++j) {
    const double x = std::abs(grid.x(j)),
                 expected = x > a ? at_edge * std::cyl_bessel_k(0.0, x / kDentReach) /
                                        std::cyl_bessel_k(0.0, t)
                                  : round_depth(x, deepest);
    EXPECT_NEAR(height[std::size_t(80 * grid.cols + j)], expected, 1e-3 * deepest) << "x " << x;
  }
}

TEST(Membrane, IsZeroWithoutContactAndTheDepthWithoutReach) {
  const Grid grid{7, 8};
  EXPECT_EQ(settled(grid, Numbers(grid.size(), 0.0)), Numbers(grid.size(), 0.0));
  const Numbers depth = on(grid, [](double x, double y) { return round_depth(x + y, 1e-4); });
  Membrane<double> none(grid.rows, grid.cols, 0, 0);
  Numbers height(grid.size());
  none.settle(depth, height);
  EXPECT_EQ(height, depth);
}

/// With an odd or even number of columns, so that the last column is of one half or the other.
class MembranePullback : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Columns, MembranePullback, ::testing::Values(15, 16));

TEST_P(MembranePullback, IsThatOfDifferences) {
  const Grid grid{13, GetParam()};
  const double deepest = 2e-4;
  const auto depth_at = [&](double shift) {
    return on(grid, [&](double x, double y) {
      return round_depth(std::hypot(x - 1e-4 - shift, y + 5e-5), deepest);
    });
  };
  Membrane<double> membrane(grid.rows, grid.cols, 3, 2.5);
  const Numbers depth = depth_at(0);
  Numbers height(grid.size()), depth_bar(grid.size()), weights(grid.size());
  testing::Random random(3);
  for (double& w : weights) w = random.uniform(-1, 1);
  const auto loss = [&](const Numbers& at) {
    Numbers h(grid.size());
    membrane.settle(at, h);
    double sum = 0;
    for (std::size_t k = 0; k < h.size(); ++k) sum += weights[k] * h[k];
    return sum;
  };
  membrane.settle(depth, height);
  membrane.pull_back(depth, height, weights, depth_bar);
  const double largest =
      std::abs(*std::max_element(depth_bar.begin(), depth_bar.end(),
                                 [](double a, double b) { return std::abs(a) < std::abs(b); }));
  int contacts = 0;
  for (std::size_t k = 0; k < depth.size(); ++k) {
    if (!(height[k] == depth[k] && depth[k] > 0)) {
      EXPECT_EQ(depth_bar[k], 0) << k;
      continue;
    }
    ++contacts;
    const double step = 1e-9;
    Numbers more = depth, less = depth;
    more[k] += step, less[k] -= step;
    EXPECT_NEAR(depth_bar[k], (loss(more) - loss(less)) / (2 * step), 1e-5 * largest) << k;
  }
  EXPECT_GT(contacts, 20);
}

/// λ solves (1 + 2 (ℓx² + ℓy²)) λ - ℓx² Σ beside - ℓy² Σ above and below = cotangent where the
/// membrane is free, and is 0 elsewhere. Sweeps are as many as its rounding needs, at any reach.
TEST(Membrane, PullsBackToTheRoundingOfADenseSolve) {
  const Grid grid{11, 12};
  const Numbers depth =
      on(grid, [&](double x, double y) { return round_depth(std::hypot(x, y), 2e-5); });
  const auto n = Eigen::Index(grid.size());
  testing::Random random(3);
  Numbers weights(grid.size()), height(grid.size()), found(grid.size());
  for (double& w : weights) w = random.uniform(-1, 1);
  for (const double reach : {0.2, 0.7, 2.0, 6.0, 25.0}) {
    SCOPED_TRACE(reach);
    const double x = reach * reach, y = 0.64 * x;
    Membrane<double> membrane(grid.rows, grid.cols, reach, 0.8 * reach);
    membrane.settle(depth, height);
    membrane.pull_back(depth, height, weights, found);
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n), beside = A;
    Eigen::VectorXd right = Eigen::Map<const Eigen::VectorXd>(weights.data(), n);
    for (int i = 0; i < grid.rows; ++i)
      for (int j = 0; j < grid.cols; ++j) {
        const int k = i * grid.cols + j;
        if (j > 0) beside(k, k - 1) = x;
        if (j + 1 < grid.cols) beside(k, k + 1) = x;
        if (i > 0) beside(k, k - grid.cols) = y;
        if (i + 1 < grid.rows) beside(k, k + grid.cols) = y;
      }
    const auto held = [&](Eigen::Index k) { return height[k] == depth[k] && depth[k] > 0; };
    A = -beside;
    A.diagonal().array() += 1 + 2 * (x + y);
    for (Eigen::Index k = 0; k < n; ++k)
      if (held(k)) A.row(k).setZero(), A(k, k) = 1, right[k] = 0;
    int held_points = 0;
    const Eigen::VectorXd pulled = beside * A.partialPivLu().solve(right);
    for (Eigen::Index k = 0; k < n; ++k) {
      held_points += held(k) ? 1 : 0;
      const double expected = held(k) ? weights[k] + pulled[k] : 0;
      EXPECT_NEAR(found[k], expected, 1e-12 * (1 + x)) << k;
    }
    EXPECT_GT(held_points, 10);
    EXPECT_LT(held_points, n / 2);
  }
}

}  // namespace
}  // namespace tangere
