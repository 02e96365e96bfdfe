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
constexpr double kLeastFreedom = 0.5;  // of residuals beyond numbers
constexpr double kLeastShare = 1e-12;  // of a direction, that a part of the residuals tells
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

/// Whether residual k is one of the first of its row (0) or of the rest (1).
std::size_t part_of(std::size_t k, const ErrorModel& errors) {
  return errors.split > 0 && k % errors.width >= errors.split ? 1 : 0;
}

/// Counts the residuals of both parts; where errors may be alike those that are not 0, or that
/// change.
std::array<double, 2> counts_of(const Columns& jacobian, std::span<const double> residuals,
                                std::size_t m, const ErrorModel& errors) {
  std::array<double, 2> out{};
  for (std::size_t k = 0; k < m; ++k)
    if (!errors.alike || (k < residuals.size() && residuals[k] != 0) ||
        std::ranges::any_of(jacobian, [k](const auto& column) { return column[k] != 0; }))
      ++out[part_of(k, errors)];
  return out;
}

/// With the columns s of a matrix S, S Sᵀ = (JᵀJ)⁻¹: Sᵀ J_bᵀ J_b S.
Matrix share_of_part(const Columns& jacobian, const Columns& solver, std::size_t part,
                     const ErrorModel& errors) {
  const auto rank = Eigen::Index(solver.size());
  if (errors.split == 0) return Matrix::Identity(rank, rank) * (part == 0 ? 1.0 : 0.0);
  const std::size_t m = jacobian.empty() ? 0 : jacobian[0].size();
  Matrix out = Matrix::Zero(rank, rank);
  Vector moved(rank);
  for (std::size_t k = 0; k < m; ++k) {
    if (part_of(k, errors) != part) continue;
    for (Eigen::Index a = 0; a < rank; ++a) {
      moved[a] = 0;
      for (std::size_t j = 0; j < jacobian.size(); ++j)
        moved[a] += solver[std::size_t(a)][j] * jacobian[j][k];
    }
    out += moved * moved.transpose();
  }
  return out;
}

/// Residuals of one part beyond the numbers that they tell.
struct PartFreedom {
  double freedom = 0, squares = 0;
};
PartFreedom freedom_of(const Columns& jacobian, std::span<const double> residuals,
                       const Matrix& share, std::size_t part, const ErrorModel& errors) {
  const std::size_t m = jacobian.empty() ? 0 : jacobian[0].size();
  PartFreedom out{counts_of(jacobian, residuals, m, errors)[part] - share.trace(), 0};
  for (std::size_t k = 0; k < residuals.size(); ++k)
    if (part_of(k, errors) == part) out.squares += residuals[k] * residuals[k];
  return out;
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
                       const ErrorModel& errors)
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
  const Vector scale = Eigen::Map<const Vector>(size_.data(), n).cwiseInverse();
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vector direction = scale.cwiseProduct(modes.eigenvectors().col(k));
    if (strength[k] < kWeakest) {
      untold_.push_back(numbers_of(direction));
      for (Eigen::Index j = 0; j < n; ++j)
        missing_[std::size_t(j)] = std::hypot(missing_[std::size_t(j)], modes.eigenvectors()(j, k));
      continue;
    }
    solver_.push_back(numbers_of(direction / std::sqrt(strength[k])));
  }
  add_spread(residuals, errors);
  if (errors.alike) add_rows(residuals, errors.width);
}

void Confidence::add_spread(std::span<const double> residuals, const ErrorModel& errors) {
  if (solver_.empty()) return;
  for (std::size_t part = 0; part < (errors.split > 0 ? 2U : 1U); ++part) {
    const Matrix share = share_of_part(jacobian_, solver_, part, errors);
    const PartFreedom of = freedom_of(jacobian_, residuals, share, part, errors);
    const bool told = of.freedom > kLeastFreedom;
    const double error = told ? student_95(std::max(1, int(of.freedom + kLeastFreedom))) *
                                    (errors.known ? 1 : std::sqrt(of.squares / of.freedom))
                              : 1;
    const Eigen::SelfAdjointEigenSolver<Matrix> modes(share);
    for (Eigen::Index k = 0; k < share.rows(); ++k) {
      if (!(modes.eigenvalues()[k] > kLeastShare)) continue;
      std::vector<double> direction(size_.size());
      for (std::size_t a = 0; a < solver_.size(); ++a)
        for (std::size_t j = 0; j < direction.size(); ++j)
          direction[j] += solver_[a][j] * modes.eigenvectors()(Eigen::Index(a), k) * error *
                          std::sqrt(modes.eigenvalues()[k]);
      (told ? spread_ : untold_).push_back(direction);
    }
  }
}

std::array<double, 2> error_deviations(const Columns& jacobian, std::span<const double> residuals,
                                       const ErrorModel& errors) {
  std::array<double, 2> out{-1, -1};
  const Confidence confidence(jacobian);
  for (std::size_t part = 0; part < 2; ++part) {
    const Matrix share = share_of_part(jacobian, confidence.solver(), part, errors);
    const PartFreedom of = freedom_of(jacobian, residuals, share, part, errors);
    if (of.freedom > kLeastFreedom) out[part] = std::sqrt(of.squares / of.freedom);
  }
  return out;
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
