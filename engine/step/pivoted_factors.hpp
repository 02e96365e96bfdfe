// SPDX-License-Identifier: Apache-2.0
// LU with row exchanges, lane by lane, for the few matrices on which plain elimination fails.
#pragma once

#include <memory>

#include "engine/step/block_factors.hpp"

namespace tangere {

class PivotedFactors {
 public:
  explicit PivotedFactors(int lanes);
  ~PivotedFactors();
  PivotedFactors(PivotedFactors&&) noexcept;
  PivotedFactors& operator=(PivotedFactors&&) noexcept;

  /// Factors the matrix of lane `lane` whose entries on the pattern, or in `blocks`, are `A`, or
  /// its
  /// transpose. Allocates the matrices of the lane on its first use.
  template <int L>
  void factor(const kernels::Pattern& pattern, const BlockEntries& blocks, const kernels::Row<L>* A,
              int lane, bool transposed);
  /// Solves lane `lane` of `out`, (n), from that of `b`, by its latest factor.
  template <int L>
  void solve(int lane, const kernels::Row<L>* b, kernels::Row<L>* out);

 private:
  struct Numbers;
  std::unique_ptr<Numbers> numbers_;
};

}  // namespace tangere
