// SPDX-License-Identifier: Apache-2.0
// The method is that of Eigen. With J = ∂r/∂x at the minimum and n numbers of m residuals, the
// covariance of x is s² (JᵀJ)⁻¹, s² = Σ r²/(m - n).
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
constexpr double kWeakest = 1e-9;      // eigenvalue of normalised columns that is an error
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

/// Fills in covariance and influences from the Jacobian at the minimum.
void judge(const Matrix& J, double squares, LeastSquares& out) {
  const Eigen::Index n = J.cols(), freedom = J.rows() - n;
  Vector size(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    size[k] = J.col(k).norm();
    out.influence.push_back(size[k] / std::sqrt(double(J.rows())));
  }
  if (freedom < 1 || !(size.minCoeff() > 0)) return;
  const Matrix scaled = J * size.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix> modes(scaled.transpose().lazyProduct(scaled));
  if (modes.eigenvalues()[0] < kWeakest) return;
  const Matrix axes = size.cwiseInverse().asDiagonal() * modes.eigenvectors(),
               shares = axes * modes.eigenvalues().cwiseInverse().asDiagonal();
  const Matrix covariance = squares / double(freedom) * shares.lazyProduct(axes.transpose());
  out.covariance.assign(covariance.data(), covariance.data() + covariance.size());
  out.student = student_95(int(freedom));
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
  out.x.assign(at.data(), at.data() + n);
  out.converged = status != Status::TooManyFunctionEvaluation &&
                  status != Status::ImproperInputParameters && at.allFinite();
  Vector r(m);
  Matrix J(m, n);
  problem(at, r);
  problem.df(at, J);
  judge(J, r.squaredNorm(), out);
  return out;
}

double LeastSquares::half_interval(std::span<const double> gradient) const {
  if (covariance.empty()) return HUGE_VAL;
  const auto n = Eigen::Index(x.size());
  const Eigen::Map<const Matrix> C(covariance.data(), n, n);
  const Eigen::Map<const Vector> g(gradient.data(), n);
  return student * std::sqrt(g.dot(C * g));
}

double student_95(int freedom) {
  static constexpr double kFew[] = {12.706, 4.303, 3.182, 2.776};
  if (freedom <= int(std::size(kFew))) return kFew[freedom - 1];
  const double z = 1.959964, v = freedom;  // Fisher's expansion
  return z + (z * z * z + z) / (4 * v) +
         (5 * std::pow(z, 5) + 16 * z * z * z + 3 * z) / (96 * v * v);
}

}  // namespace tangere
