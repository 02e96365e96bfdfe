// SPDX-License-Identifier: Apache-2.0
// With intervals h_k and their slopes Δ_k, the slope at an inner point is
//   3 (h_0 + h_1)/((2 h_1 + h_0)/Δ_0 + (h_1 + 2 h_0)/Δ_1),  0 where Δ_0 or Δ_1 is,
// and at an end ((2 h_0 + h_1) Δ_0 - h_0 Δ_1)/(h_0 + h_1), between 0 and 3 Δ_0.
#include "engine/model/monotone_cubic.hpp"

#include <algorithm>
#include <utility>

namespace tangere {
namespace {

double inner_slope(double h0, double h1, double d0, double d1) {
  if (!(d0 > 0 && d1 > 0)) return 0;
  return 3 * (h0 + h1) / ((2 * h1 + h0) / d0 + (h1 + 2 * h0) / d1);
}

double end_slope(double h0, double h1, double d0, double d1) {
  return std::clamp(((2 * h0 + h1) * d0 - h0 * d1) / (h0 + h1), 0.0, 3 * d0);
}

}  // namespace

MonotoneCubic::MonotoneCubic(std::vector<double> x, std::vector<double> y)
    : x_(std::move(x)), y_(std::move(y)), slope_(x_.size()) {
  const std::size_t n = x_.size();
  const auto width = [&](std::size_t k) { return x_[k + 1] - x_[k]; };
  const auto rise = [&](std::size_t k) { return (y_[k + 1] - y_[k]) / width(k); };
  if (n == 2) {
    slope_ = {rise(0), rise(0)};
    return;
  }
  slope_[0] = end_slope(width(0), width(1), rise(0), rise(1));
  for (std::size_t k = 1; k + 1 < n; ++k)
    slope_[k] = inner_slope(width(k - 1), width(k), rise(k - 1), rise(k));
  slope_[n - 1] = end_slope(width(n - 2), width(n - 3), rise(n - 2), rise(n - 3));
}

MonotoneCubic::Point MonotoneCubic::at(double x) const {
  if (x >= x_.back()) return {y_.back() + slope_.back() * (x - x_.back()), slope_.back()};
  const auto k = std::size_t(std::upper_bound(x_.begin() + 1, x_.end() - 1, x) - x_.begin()) - 1;
  const double h = x_[k + 1] - x_[k], s = (x - x_[k]) / h, rise = (y_[k + 1] - y_[k]) / h;
  const double c = slope_[k] + slope_[k + 1] - 2 * rise,
               b = 3 * rise - 2 * slope_[k] - slope_[k + 1];
  return {y_[k] + h * s * (slope_[k] + s * (b + s * c)), slope_[k] + s * (2 * b + 3 * s * c)};
}

}  // namespace tangere
