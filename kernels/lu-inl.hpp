// SPDX-License-Identifier: Apache-2.0
// Sparse LU without pivoting in lanes, on the scene's pattern, and a watched solve.
//
// The elimination is interpreted: all lanes share one list of slots. Without pivoting a factor can be useless, so each
// solve is refined once and judged in the scaling S = diag(|a_ii|^-1/2), which makes the figures free of units:
//   accepted if β = ‖S(b - Ax)‖∞ / (‖SAS‖∞ ‖S⁻¹x‖∞ + ‖Sb‖∞) ≤ 1e-13 and the correction ≤ 1e-6 ‖S⁻¹x‖∞
#pragma once

#include "kernels/model_view.hpp"

namespace tangere::kernels {

/// Factors A into LU (factor_entries) where `accept` is 1, keeps LU elsewhere. Unit lower factor; U's diagonal is
/// stored as its reciprocal. `work`: (factor_entries).
template <class N>
void factor(const Pattern& p, const N* A, const N& accept, N* LU, N* work) {
  for (int e = 0; e < p.factor_entries; ++e) work[e] = N(0.0);
  for (int e = 0; e < p.entries; ++e) work[p.scatter[e]] = A[e];
  const int* target = p.target;
  for (int k = 0; k < p.n; ++k) {
    const N inverse = 1.0 / work[p.diagonal[k]];
    work[p.diagonal[k]] = inverse;
    for (int c = p.column_begin[k]; c < p.column_begin[k + 1]; ++c) {
      const N l = work[p.column_slot[c]] * inverse;
      work[p.column_slot[c]] = l;
      for (int r = p.row_begin[k]; r < p.row_begin[k + 1]; ++r, ++target)
        work[*target] = mul_sub_from(l, work[p.row_slot[r]], work[*target]);
    }
  }
  const auto mask = accept > N(0.0);
  for (int e = 0; e < p.factor_entries; ++e) LU[e] = select(mask, work[e], LU[e]);
}

/// x = A⁻¹ b from the factor. b and x in dof order; `work`: (n).
template <class N>
void solve(const Pattern& p, const N* LU, const N* b, N* x, N* work) {
  for (int k = 0; k < p.n; ++k) work[k] = b[p.permutation[k]];
  for (int k = 0; k < p.n; ++k)
    for (int c = p.column_begin[k]; c < p.column_begin[k + 1]; ++c)
      work[p.column_row[c]] = mul_sub_from(LU[p.column_slot[c]], work[k], work[p.column_row[c]]);
  for (int k = p.n - 1; k >= 0; --k) {
    N sum = work[k];
    for (int r = p.row_begin[k]; r < p.row_begin[k + 1]; ++r)
      sum = mul_sub_from(LU[p.row_slot[r]], work[p.row_column[r]], sum);
    work[k] = sum * LU[p.diagonal[k]];
    x[p.permutation[k]] = work[k];
  }
}

/// b - A x.
template <class N>
void defect(const Pattern& p, const N* A, const N* x, const N* b, N* out) {
  for (int i = 0; i < p.n; ++i) {
    N sum = b[i];
    for (int e = p.entry_begin[i]; e < p.entry_begin[i + 1]; ++e)
      sum = mul_sub_from(A[e], x[p.entry_column[e]], sum);
    out[i] = sum;
  }
}

/// x = A⁻¹ b, refined once; `sound` is 1 where the result passed the test above. `work`: (4 n).
template <class N>
void solve_watched(const Pattern& p, const N* A, const N* LU, const N* b, N* x, N* sound, N* work) {
  const int n = p.n;
  N *residual = work, *correction = work + n, *scale = work + 2 * n, *scratch = work + 3 * n;
  const N zero(0.0), one(1.0);
  solve(p, LU, b, x, scratch);
  defect(p, A, x, b, residual);
  solve(p, LU, residual, correction, scratch);
  for (int i = 0; i < n; ++i) x[i] = x[i] + correction[i];
  defect(p, A, x, b, residual);
  for (int i = 0; i < n; ++i) {
    const N diagonal = abs(A[p.slot[i * n + i]]);
    scale[i] = one / sqrt(select(diagonal > zero, diagonal, one));
  }
  N norm_r = zero, norm_b = zero, norm_x = zero, norm_d = zero, norm_a = zero;
  for (int i = 0; i < n; ++i) {
    norm_r = max(abs(residual[i]) * scale[i], norm_r);
    norm_b = max(abs(b[i]) * scale[i], norm_b);
    norm_x = max(abs(x[i]) / scale[i], norm_x);
    norm_d = max(abs(correction[i]) / scale[i], norm_d);
    N row = zero;
    for (int e = p.entry_begin[i]; e < p.entry_begin[i + 1]; ++e)
      row = mul_add(abs(A[e]), scale[p.entry_column[e]], row);
    norm_a = max(row * scale[i], norm_a);
  }
  // A NaN anywhere reaches x and fails the finiteness test, because max() above drops it.
  N finite = zero;
  for (int i = 0; i < n; ++i) finite = mul_add(zero, x[i], finite);
  const auto ok = (norm_r <= 1e-13 * mul_add(norm_a, norm_x, norm_b)) & (norm_d <= 1e-6 * norm_x) & (finite <= zero);
  *sound = select(ok, one, zero);
}

}  // namespace tangere::kernels
