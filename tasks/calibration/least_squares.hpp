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
  /// (n, n) covariance of x. Empty without more residuals than numbers, or where the residuals do
  /// not tell the numbers from each other.
  std::vector<double> covariance;
  /// Of Student's distribution with as many degrees of freedom as there are more residuals than
  /// numbers: t with P(|T| ≤ t) = 0.95.
  double student = 0;
  /// Root mean square change of the residuals by a unit of each number.
  std::vector<double> influence;
  bool converged = false;

  /// Returns half of the 95 % interval of a number that changes by `gradient` · dx; infinite where
  /// it is not known.
  [[nodiscard]] double half_interval(std::span<const double> gradient) const;
};

/// Minimises Σ r² from `x`. Derivatives are central differences, in shares of x.
LeastSquares minimise(const Residuals& residuals, std::vector<double> x);

/// Returns t with P(|T| ≤ t) = 0.95 for Student's distribution with `freedom` ≥ 1 degrees of
/// freedom, to 0.3 %.
double student_95(int freedom);

}  // namespace tangere
