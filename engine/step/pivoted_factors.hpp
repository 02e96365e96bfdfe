// SPDX-License-Identifier: Apache-2.0
// LU with row exchanges, lane by lane, for the few matrices that plain elimination spoils.
#pragma once

#include <memory>

#include "kernels/step/model_view.hpp"

namespace tangere {

class PivotedFactors {
 public:
  /// For `lanes` matrices of (n, n).
  PivotedFactors(int lanes, int n);
  ~PivotedFactors();
  PivotedFactors(PivotedFactors&&) noexcept;
  PivotedFactors& operator=(PivotedFactors&&) noexcept;

  /// Of lane `lane` of the matrix whose entries on the pattern are `A`, or of its transpose.
  template <int L>
  void factor(const kernels::Pattern& pattern, const kernels::Row<L>* A, int lane, bool transposed);
  /// That lane of (n) `out` from that of `b`, by its latest factor.
  template <int L>
  void solve(int lane, const kernels::Row<L>* b, kernels::Row<L>* out);

  /// Of memory.
  static std::size_t bytes(int lanes, int n);

 private:
  struct Numbers;
  std::unique_ptr<Numbers> numbers_;
};

}  // namespace tangere
