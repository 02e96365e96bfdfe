// SPDX-License-Identifier: Apache-2.0
// Uses Eigen. Its headers take a second to parse, so no other source includes them.
#include "engine/step/pivoted_factors.hpp"

#include <Eigen/LU>
#include <vector>

namespace tangere {

using kernels::Row;

struct PivotedFactors::Numbers {
  std::vector<Eigen::PartialPivLU<Eigen::MatrixXd>> lu;  // (lanes)
  Eigen::MatrixXd A;                                     // the matrix being factored
  Eigen::VectorXd x;
};

PivotedFactors::PivotedFactors(int lanes, int n)
    : numbers_(std::make_unique<Numbers>(
          Numbers{{std::size_t(lanes), Eigen::PartialPivLU<Eigen::MatrixXd>(n)},
                  Eigen::MatrixXd(n, n),
                  Eigen::VectorXd(n)})) {}
PivotedFactors::~PivotedFactors() = default;
PivotedFactors::PivotedFactors(PivotedFactors&&) noexcept = default;
PivotedFactors& PivotedFactors::operator=(PivotedFactors&&) noexcept = default;

template <int L>
void PivotedFactors::factor(const kernels::Pattern& pattern, const Row<L>* A, int lane,
                            bool transposed) {
  Eigen::MatrixXd& dense = numbers_->A;
  for (int i = 0; i < pattern.n; ++i)
    for (int j = 0; j < pattern.n; ++j) {
      const int slot = pattern.slot[i * pattern.n + j];
      (transposed ? dense(j, i) : dense(i, j)) = slot < 0 ? 0 : A[slot][lane];
    }
  numbers_->lu[std::size_t(lane)].compute(dense);
}

template <int L>
void PivotedFactors::solve(int lane, const Row<L>* b, Row<L>* out) {
  Eigen::VectorXd& x = numbers_->x;
  for (int i = 0; i < x.size(); ++i) x[i] = b[i][lane];
  x = numbers_->lu[std::size_t(lane)].solve(x).eval();
  for (int i = 0; i < x.size(); ++i) out[i][lane] = x[i];
}

std::size_t PivotedFactors::bytes(int lanes, int n) {
  return sizeof(double) * std::size_t(n) * std::size_t(n + 1) * std::size_t(lanes + 1);
}

template void PivotedFactors::factor(const kernels::Pattern&, const Row<1>*, int, bool);
template void PivotedFactors::factor(const kernels::Pattern&, const Row<kernels::kGroup>*, int,
                                     bool);
template void PivotedFactors::solve(int, const Row<1>*, Row<1>*);
template void PivotedFactors::solve(int, const Row<kernels::kGroup>*, Row<kernels::kGroup>*);

}  // namespace tangere
