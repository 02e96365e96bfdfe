// SPDX-License-Identifier: Apache-2.0
// Nonlinear least squares by Levenberg and Marquardt's method, and how well the numbers are known.
#pragma once

#include <functional>
#include <span>
#include <vector>

namespace tangere {

/// Computes the residuals, of one length at all x.
using Residuals = std::function<std::vector<double>(std::span<const double> x)>;

struct LeastSquares {
  std::vector<double> x;
  /// Half of the 95 % interval of each number, by Student's distribution with as many degrees of
  /// freedom as there are more residuals than numbers. Infinite without any, or where the residuals
  /// do not tell the number from others.
  std::vector<double> half_interval;
  /// Root mean square change of the residuals by a unit of each number.
  std::vector<double> influence;
  bool converged = false;
};

/// Minimises Σ r² from `x`. Derivatives are central differences.
LeastSquares minimise(const Residuals& residuals, std::vector<double> x);

/// Returns t with P(|T| ≤ t) = 0.95 for Student's distribution with `freedom` ≥ 1 degrees of
/// freedom, to 0.3 %.
double student_95(int freedom);

}  // namespace tangere
