// SPDX-License-Identifier: Apache-2.0
// The method is that of Eigen. With J = ∂r/∂x and its columns scaled to a norm of 1, the modes of
// JᵀJ whose eigenvalue is above rounding are told. Errors of numbers y that were found before move
// x by -(JᵀJ)⁻¹ Jᵀ ∂r/∂y.
#include "tasks/calibration/least_squares.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>

namespace tangere {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

constexpr double kDifference = 1e-10;  // relative error of the residuals, of which steps are roots
constexpr double kLineStep = 5e-4;     // the third root of kDifference
constexpr double kWeakest = 1e-9;      // eigenvalue of normalised columns that is an error
constexpr double kUntoldShare = 1e-3;  // of a number, along what is not told
constexpr Eigen::Index kMostPasses = 200;

struct Problem {
  using Scalar = double;
  using InputType = Vector;
  using ValueType = Vector;
  using JacobianType = Matrix;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };

  const Residuals& residuals;
  Eigen::Index inputs_, values_;

  [[nodiscard]] Eigen::Index inputs() const { return inputs_; }
  [[nodiscard]] Eigen::Index values() const { return values_; }
  int operator()(const Vector& x, Vector& out) const {
    const std::vector<double> r = residuals({x.data(), std::size_t(x.size())});
    out = Eigen::Map<const Vector>(r.data(), Eigen::Index(r.size()));
    return 0;
  }
};
using Differences = Eigen::NumericalDiff<Problem, Eigen::Central>;

std::vector<double> numbers_of(const Vector& v) { return {v.data(), v.data() + v.size()}; }

double dot(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) sum += a[k] * b[k];
  return sum;
}

double norm(std::span<const double> a) { return std::sqrt(dot(a, a)); }

/// Counts the residuals that are not 0, or that change.
Eigen::Index telling(const Columns& jacobian, std::span<const double> residuals) {
  Eigen::Index count = 0;
  for (std::size_t k = 0; k < residuals.size(); ++k)
    count += residuals[k] != 0 ||
             std::ranges::any_of(jacobian, [k](const auto& column) { return column[k] != 0; });
  return count;
}

}  // namespace

LeastSquares minimise(const Residuals& residuals, std::vector<double> x) {
  const auto n = Eigen::Index(x.size()), m = Eigen::Index(residuals(x).size());
  Differences problem(Problem{residuals, n, m}, kDifference);
  Eigen::LevenbergMarquardt<Differences> method(problem);
  method.parameters.ftol = method.parameters.xtol = 1e-10;
  method.parameters.maxfev = kMostPasses * (2 * n + 1);
  Vector at = Eigen::Map<const Vector>(x.data(), n);
  using Status = Eigen::LevenbergMarquardtSpace::Status;
  const Status status = method.minimize(at);
  LeastSquares out;
  out.x = numbers_of(at);
  out.converged = status != Status::TooManyFunctionEvaluation &&
                  status != Status::ImproperInputParameters && at.allFinite();
  Vector r(m);
  Matrix J(m, n);
  problem(at, r);
  problem.df(at, J);
  out.residuals = numbers_of(r);
  for (Eigen::Index k = 0; k < n; ++k) out.jacobian.push_back(numbers_of(J.col(k)));
  return out;
}

double LeastSquares::influence(std::size_t k) const {
  return norm(jacobian[k]) / std::sqrt(double(residuals.size()));
}

std::vector<double> slope_along(const std::function<std::vector<double>(double)>& residuals) {
  const std::vector<double> before = residuals(-kLineStep);
  std::vector<double> out = residuals(kLineStep);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = (out[k] - before[k]) / (2 * kLineStep);
  return out;
}

Confidence::Confidence(const Columns& jacobian, std::span<const double> residuals,
                       std::size_t width)
    : jacobian_(jacobian) {
  const auto n = Eigen::Index(jacobian.size());
  if (n == 0) return;
  const auto m = Eigen::Index(jacobian[0].size());
  missing_.assign(jacobian.size(), 0);
  Matrix J(m, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const std::vector<double>& column = jacobian[std::size_t(k)];
    size_.push_back(norm(column));
    if (!(size_.back() > 0)) size_.back() = 1;  // not told
    J.col(k) = Eigen::Map<const Vector>(column.data(), m) / size_.back();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix> modes(J.transpose().lazyProduct(J));
  const Vector& strength = modes.eigenvalues();
  const auto rank = std::ranges::count_if(strength, [](double s) { return s >= kWeakest; });
  const Eigen::Index freedom = (width > 1 ? telling(jacobian, residuals) : m) - rank;
  const double error =
      freedom > 0 ? student_95(int(freedom)) * norm(residuals) / std::sqrt(double(freedom)) : 0;
  const Vector scale = Eigen::Map<const Vector>(size_.data(), n).cwiseInverse();
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vector direction = scale.cwiseProduct(modes.eigenvectors().col(k));
    if (strength[k] < kWeakest) {
      untold_.push_back(numbers_of(direction));
      for (Eigen::Index j = 0; j < n; ++j)
        missing_[std::size_t(j)] = std::hypot(missing_[std::size_t(j)], modes.eigenvectors()(j, k));
      continue;
    }
    const double deviation = 1 / std::sqrt(strength[k]);
    solver_.push_back(numbers_of(direction * deviation));
    if (freedom > 0)
      spread_.push_back(numbers_of(direction * deviation * error));
    else
      untold_.push_back(numbers_of(direction));
  }
  if (width > 1 && m / Eigen::Index(width) > rank) add_rows(residuals, width);
}

void Confidence::add_rows(std::span<const double> residuals, std::size_t width) {
  const std::size_t n = residuals.size() / width, rank = solver_.size();
  if (n <= rank) return;
  const auto freedom = double(n - rank);
  const double factor = student_95(int(n - rank)) * std::sqrt(double(n) / freedom);
  for (std::size_t row = 0; row < n; ++row) {
    std::vector<double> change(residuals.size());
    for (std::size_t k = row * width; k < (row + 1) * width; ++k) change[k] = residuals[k] * factor;
    std::vector<double>& moved = rows_.emplace_back();
    for (std::size_t k = 0; k < size_.size(); ++k) moved.push_back(answer(k, change));
  }
}

double Confidence::answer(std::size_t k, std::span<const double> change) const {
  double sum = 0;
  for (const std::vector<double>& direction : solver_) {
    double both = 0;
    for (std::size_t j = 0; j < jacobian_.size(); ++j)
      both += direction[j] * dot(jacobian_[j], change);
    sum -= direction[k] * both;
  }
  return sum;
}

void Confidence::add_errors_of(const Confidence& before, const Columns& by) {
  const auto moved = [&](const std::vector<double>& direction) {
    std::vector<double> change(by.empty() ? 0 : by[0].size()), out;
    for (std::size_t j = 0; j < by.size(); ++j)
      for (std::size_t row = 0; row < change.size(); ++row)
        change[row] += direction[j] * by[j][row];
    for (std::size_t k = 0; k < size_.size(); ++k) out.push_back(answer(k, change));
    return out;
  };
  for (const std::vector<double>& direction : before.spread_) spread_.push_back(moved(direction));
  for (const std::vector<double>& direction : before.rows_) rows_.push_back(moved(direction));
  for (const std::vector<double>& direction : before.untold_) untold_.push_back(moved(direction));
}

double Confidence::half_interval(std::span<const double> gradient) const {
  double least = 0;
  for (std::size_t k = 0; k < std::min(gradient.size(), size_.size()); ++k)
    least += std::pow(gradient[k] / size_[k], 2);
  least = kUntoldShare * std::sqrt(least);
  for (const std::vector<double>& direction : untold_)
    if (std::abs(dot(gradient, direction)) > least) return HUGE_VAL;
  const auto along = [&](const Columns& directions) {
    double squares = 0;
    for (const std::vector<double>& direction : directions)
      squares += std::pow(dot(gradient, direction), 2);
    return std::sqrt(squares);
  };
  return std::max(along(spread_), along(rows_));
}

bool Confidence::rank_misses(std::size_t k) const { return missing_[k] > kUntoldShare; }

double Confidence::correlation(std::size_t a, std::size_t b) const {
  if (rank_misses(a) && rank_misses(b)) return 1;
  double both = 0, aa = 0, bb = 0;
  for (const std::vector<double>& direction : solver_) {
    both += direction[a] * direction[b];
    aa += direction[a] * direction[a], bb += direction[b] * direction[b];
  }
  return both / std::sqrt(aa * bb);
}

double student_95(int freedom) {
  static constexpr double kFew[] = {12.706, 4.303, 3.182, 2.776};
  if (freedom <= int(std::size(kFew))) return kFew[freedom - 1];
  const double z = 1.959964, v = freedom;  // Fisher's expansion
  return z + (z * z * z + z) / (4 * v) +
         (5 * std::pow(z, 5) + 16 * z * z * z + 3 * z) / (96 * v * v);
}

}  // namespace tangere
