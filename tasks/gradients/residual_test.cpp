// SPDX-License-Identifier: Apache-2.0
// The residual of single points does not separate model error from noise. Sums over a touched area
// do, because noise averages out.
#include "tasks/gradients/residual_test.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr int kFewestPoints = 4;  // of a sum; that of one point is always ±1
constexpr int kFewestSums = 20;
constexpr double kMostChiSquare = 1.1;  // the noise of a sensor is hardly known better

/// z of one component of a sensor in one reading; NaN where the fit touches too few points.
double normalised_sum(const double* fitted, const double* recorded, int points, int component) {
  double sum = 0, squares = 0;
  int touched = 0;
  for (int i = 0; i < points; ++i) {
    const double* f = fitted + 3 * i;
    if (f[0] == 0 && f[1] == 0 && f[2] == 0) continue;
    const double r = f[component] - recorded[3 * i + component];
    sum += r;
    squares += r * r;
    ++touched;
  }
  return touched < kFewestPoints || squares == 0 ? std::nan("") : sum / std::sqrt(squares);
}

/// Squared norms of the residual and of the recorded fields, and their count of numbers.
struct Squares {
  double left = 0, recorded = 0, count = 0;
};
Squares squares_of(const FieldSequence& fitted, const FieldSequence& recorded) {
  Squares s;
  for (std::size_t k = 0; k < recorded.readings.size(); ++k)
    for (std::size_t i = 0; i < recorded.readings[k].size(); ++i) {
      const double f = recorded.readings[k][i], r = fitted.readings[k][i] - f;
      s.left += r * r;
      s.recorded += f * f;
      ++s.count;
    }
  return s;
}

/// The sums of one component of one sensor over the readings.
struct Series {
  double square = 0, product = 0, sum = 0;
  int count = 0, pairs = 0;

  void add(double z, double before) {
    if (std::isnan(z)) return;
    square += z * z;
    sum += z;
    ++count;
    if (std::isnan(before)) return;
    product += z * before;
    ++pairs;
  }
};

}  // namespace

ResidualTest test_residuals(const Model& model, const FieldSequence& fitted,
                            const FieldSequence& recorded, double noise) {
  ResidualTest test;
  const Squares squares = squares_of(fitted, recorded);
  if (noise > 0) {
    test.chi_square = squares.left / (squares.count * noise * noise);
    if (test.chi_square > kMostChiSquare) {
      test.tested = true;
      test.score = (test.chi_square - 1) * std::sqrt(squares.count / 2);
    }
  }
  if (squares.left < ResidualTest::kLeast * ResidualTest::kLeast * squares.recorded) return test;
  Series all;
  std::size_t first = 0;
  for (const SensorInfo& sensor : model.sensors()) {
    for (int component = 0; component < 3; ++component) {
      Series series;
      double before = std::nan("");
      for (std::size_t k = 0; k < recorded.readings.size(); ++k) {
        const double z =
            normalised_sum(fitted.readings[k].data() + first, recorded.readings[k].data() + first,
                           sensor.points, component);
        series.add(z, before);
        before = z;
      }
      all.square += series.square, all.product += series.product;
      all.count += series.count, all.pairs += series.pairs;
      const double mean = series.count > 0 ? series.sum / series.count : 0;
      test.score = std::max(test.score, std::abs(mean) * std::sqrt(double(series.count)));
      if (std::abs(mean) > std::abs(test.mean)) test.mean = mean, test.sensor = sensor.name;
    }
    first += 3 * static_cast<std::size_t>(sensor.points);
  }
  if (all.count < kFewestSums) {
    test.score = test.chi_square > kMostChiSquare ? test.score : 0;
    return test;
  }
  test.tested = true;
  test.spread = all.square / all.count;
  test.persistence = all.pairs > 0 ? all.product / all.pairs : 0;
  test.excess = std::max(0.0, all.square - all.count);
  test.score = std::max({test.score, (test.spread - 1) * std::sqrt(all.count / 2.0),
                         test.persistence * std::sqrt(double(all.pairs))});
  return test;
}

}  // namespace tangere
