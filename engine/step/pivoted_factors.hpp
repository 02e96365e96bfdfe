// SPDX-License-Identifier: Apache-2.0
// LU with row exchanges, lane by lane, for the few matrices on which plain elimination fails.
#pragma once

#include <memory>

#include "kernels/step/model_view.hpp"

namespace tangere {

class PivotedFactors {
 public:
  /// Makes room for `lanes` matrices of (n, n).
  PivotedFactors(int lanes, int n);
  ~PivotedFactors();
  PivotedFactors(PivotedFactors&&) noexcept;
  PivotedFactors& operator=(PivotedFactors&&) noexcept;

  /// Factors the matrix of lane `lane` whose entries on the pattern are `A`, or its transpose.
  template <int L>
  void factor(const kernels::Pattern& pattern, const kernels::Row<L>* A, int lane, bool transposed);
  /// Solves lane `lane` of `out`, (n), from that of `b`, by its latest factor.
  template <int L>
  void solve(int lane, const kernels::Row<L>* b, kernels::Row<L>* out);

  /// Returns the size of its buffers [bytes].
  static std::size_t bytes(int lanes, int n);

 private:
  struct Numbers;
  std::unique_ptr<Numbers> numbers_;
};

}  // namespace tangere
