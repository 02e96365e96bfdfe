// SPDX-License-Identifier: Apache-2.0
// Nonlinear least squares by Levenberg and Marquardt's method, and how well the numbers are known.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

namespace tangere {

/// Computes the residuals, of one length at all x.
using Residuals = std::function<std::vector<double>(std::span<const double> x)>;

/// A matrix as its columns, of one length.
using Columns = std::vector<std::vector<double>>;

struct LeastSquares {
  std::vector<double> x;
  std::vector<double> residuals;  ///< at x
  Columns jacobian;               ///< of the residuals by each number, at x
  bool converged = false;

  /// Returns the root mean square change of the residuals by a unit of number k.
  [[nodiscard]] double influence(std::size_t k) const;
};

/// Minimises Σ r² from `x`. Derivatives are central differences, in shares of x.
LeastSquares minimise(const Residuals& residuals, std::vector<double> x);

/// Returns the derivative of the residuals along a line x + s direction at s = 0, by central
/// differences.
std::vector<double> slope_along(const std::function<std::vector<double>(double s)>& residuals);

/// What is assumed of the errors of residuals, which come in rows of `width`.
struct ErrorModel {
  std::size_t width = 1;
  /// The first residuals of each row have errors of one variance, and the rest of another; 0: all
  /// have one.
  std::size_t split = 0;
  bool alike = false;  ///< whether errors within a row may be alike, as those of one press
  bool known = false;  ///< whether residuals are in units of their standard deviations
};

/// What residuals r with the Jacobian J tell of numbers x. Gauss and Newton's covariance is
/// s² (JᵀJ)⁻¹ with s² = Σ r²/(m - rank J), on the directions of x that change the residuals. The
/// others are not told, and none is without more residuals than that rank. Residuals b of two
/// variances have s_b² = Σ_b r²/(m_b - tr H_b) each, H_b = J_b (JᵀJ)⁻¹ J_bᵀ, and the covariance
/// Σ_b s_b² (JᵀJ)⁻¹ J_bᵀJ_b (JᵀJ)⁻¹. Where errors of a row may be alike, the covariance is also
/// that of whole rows g, n/(n - rank J) Σ_g (JᵀJ)⁻¹ J_gᵀ r_g r_gᵀ J_g (JᵀJ)⁻¹ with n rows, and the
/// larger counts.
class Confidence {
 public:
  Confidence() = default;
  /// `residuals`: empty: 0. Where errors of a row may be alike, residuals that are 0 and do not
  /// change are none.
  explicit Confidence(const Columns& jacobian, std::span<const double> residuals = {},
                      const ErrorModel& errors = {});

  /// Adds the errors of numbers y that were found before, with the confidence `before`. `by`: the
  /// derivatives of the residuals by y.
  void add_errors_of(const Confidence& before, const Columns& by);

  /// Returns half of the 95 % interval of a number that changes by `gradient` · dx; infinite where
  /// it is not told. A shorter gradient goes on with zeros.
  [[nodiscard]] double half_interval(std::span<const double> gradient) const;
  /// Correlation of the errors of two numbers; 1 where only their sum or difference is told.
  [[nodiscard]] double correlation(std::size_t a, std::size_t b) const;
  /// Returns how far number k goes to keep the residuals least, by a `change` of them.
  [[nodiscard]] double answer(std::size_t k, std::span<const double> change) const;
  /// Directions s of x with Σ s sᵀ = (JᵀJ)⁻¹, where the residuals tell them.
  [[nodiscard]] const Columns& solver() const { return solver_; }
  /// Whether number k has a share in a direction that does not change the residuals.
  [[nodiscard]] bool rank_misses(std::size_t k) const;

 private:
  void add_spread(std::span<const double> residuals, const ErrorModel& errors);
  void add_rows(std::span<const double> residuals, std::size_t width);

  std::vector<double> size_;  ///< norms of the columns of J
  Columns jacobian_;
  Columns spread_;  ///< 95 % intervals along independent directions of x
  Columns rows_;    ///< as spread_, of the errors of whole rows; empty without rows of several
  Columns untold_;  ///< directions of x whose residuals change by no more than rounding
  Columns solver_;  ///< the sum of s sᵀ is (JᵀJ)⁻¹ on the told directions
  std::vector<double> missing_;  ///< shares of the numbers in the other directions, 0 to 1
};

/// Standard deviations s_b of the errors of residuals of two variances, as Confidence has them: of
/// the first of each row and of the rest; -1 where there are no more residuals than numbers.
std::array<double, 2> error_deviations(const Columns& jacobian, std::span<const double> residuals,
                                       const ErrorModel& errors);

/// Returns t with P(|T| ≤ t) = 0.95 for Student's distribution with `freedom` ≥ 1 degrees of
/// freedom, to 0.3 %.
double student_95(int freedom);

}  // namespace tangere
