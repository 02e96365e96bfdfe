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

PivotedFactors::PivotedFactors(int lanes)
    : numbers_(std::make_unique<Numbers>(Numbers{
          std::vector<Eigen::PartialPivLU<Eigen::MatrixXd>>(std::size_t(lanes)), {}, {}})) {}
PivotedFactors::~PivotedFactors() = default;
PivotedFactors::PivotedFactors(PivotedFactors&&) noexcept = default;
PivotedFactors& PivotedFactors::operator=(PivotedFactors&&) noexcept = default;

template <int L>
void PivotedFactors::factor(const kernels::Pattern& p, const BlockEntries& blocks, const Row<L>* A,
                            int lane, bool transposed) {
  Eigen::MatrixXd& dense = numbers_->A;
  dense.resize(p.n, p.n);
  numbers_->x.resize(p.n);
  for (int i = 0; i < p.n; ++i)
    for (int j = 0; j < p.n; ++j) {
      const int slot = p.slot != nullptr ? p.slot[i * p.n + j] : blocks.entry(p, i, j);
      const bool stored = slot >= 0 && (p.slot == nullptr || slot < p.entries);
      (transposed ? dense(j, i) : dense(i, j)) = stored ? A[slot][lane] : 0;
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

template void PivotedFactors::factor(const kernels::Pattern&, const BlockEntries&, const Row<1>*,
                                     int, bool);
template void PivotedFactors::factor(const kernels::Pattern&, const BlockEntries&,
                                     const Row<kernels::kGroup>*, int, bool);
template void PivotedFactors::solve(int, const Row<1>*, Row<1>*);
template void PivotedFactors::solve(int, const Row<kernels::kGroup>*, Row<kernels::kGroup>*);

}  // namespace tangere
