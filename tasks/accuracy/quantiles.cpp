// SPDX-License-Identifier: Apache-2.0
// The numbers are order statistics: nothing is assumed about how errors are distributed.
#include "tasks/accuracy/quantiles.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/base/as_size.hpp"

namespace tangere {

double quantile(std::vector<double> numbers, double share) {
  std::erase_if(numbers, [](double x) { return std::isnan(x); });
  if (numbers.empty()) return std::nan("");
  std::sort(numbers.begin(), numbers.end());
  const double rank = std::ceil(share * static_cast<double>(numbers.size()));
  return numbers[as_size(std::max(0, static_cast<int>(rank) - 1))];
}

double sure_quantile(std::vector<double> numbers, double share) {
  std::erase_if(numbers, [](double x) { return std::isnan(x); });
  if (numbers.empty()) return std::nan("");
  std::sort(numbers.begin(), numbers.end(), std::greater<>());
  const double beyond = 1 - share, n = static_cast<double>(numbers.size());
  // Chances of k larger ones, by logarithms: shareⁿ is no number for many environments.
  const auto chance = [&](double k) {
    return std::exp(std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1) +
                    k * std::log(beyond) + (n - k) * std::log(share));
  };
  double sum = chance(0);
  std::size_t larger = 0;
  while (larger + 1 < numbers.size()) {
    sum += chance(static_cast<double>(larger + 1));
    if (sum > beyond) break;
    ++larger;
  }
  return numbers[larger];
}

}  // namespace tangere
