// SPDX-License-Identifier: Apache-2.0
// Coefficients of the splines are the points' values themselves: approximating splines.
#include "engine/picture/picture_grid.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {

template <class T>
SplineWeights<T> spline_weights(double at, int points, Outside outside) {
  // Far from the grid every weight is 0, or that of the edge.
  at = std::clamp(at, -4.0, points + 3.0);
  const double floor = std::floor(at), t = at - floor, s = 1 - t;
  const std::array value{s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
                         (3 * s * s * s - 6 * s * s + 4) / 6, t * t * t / 6};
  const std::array slope{-s * s / 2, (3 * t * t - 4 * t) / 2, -(3 * s * s - 4 * s) / 2, t * t / 2};
  SplineWeights<T> w;
  for (std::size_t k = 0; k < 4; ++k) {
    const int point = static_cast<int>(floor) - 1 + static_cast<int>(k),
              inside = std::clamp(point, 0, points - 1);
    const bool counts = outside == Outside::nearest || inside == point;
    w.point[k] = inside;
    w.value[k] = counts ? static_cast<T>(value[k]) : T(0);
    w.slope[k] = counts ? static_cast<T>(slope[k]) : T(0);
  }
  return w;
}

template <class T>
std::vector<SplineWeights<T>> pixel_weights(int pixels, double size, int points, double pitch,
                                            Outside outside) {
  std::vector<SplineWeights<T>> weights;
  for (int k = 0; k < pixels; ++k) {
    const double place = ((k + 0.5) / pixels - 0.5) * size;
    weights.push_back(spline_weights<T>(place / pitch + 0.5 * (points - 1), points, outside));
    for (T& x : weights.back().slope) x = static_cast<T>(static_cast<double>(x) / pitch);
  }
  return weights;
}

template SplineWeights<float> spline_weights(double, int, Outside);
template SplineWeights<double> spline_weights(double, int, Outside);
template std::vector<SplineWeights<float>> pixel_weights(int, double, int, double, Outside);
template std::vector<SplineWeights<double>> pixel_weights(int, double, int, double, Outside);

}  // namespace tangere
