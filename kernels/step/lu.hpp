// SPDX-License-Identifier: Apache-2.0
// Sparse LU without pivoting in lanes, on the scene's pattern, and a solve that checks its result.
//
// The elimination is interpreted: all lanes share one list of slots. Without pivoting a factor can
// be inaccurate. Each solve is therefore refined once, and its backward error is tested in the
// scaling S = diag(|a_ii|^-1/2), which removes all units:
//   accepted if β = ‖S(b - Ax)‖∞ / (‖SAS‖∞ ‖S⁻¹x‖∞ + ‖Sb‖∞) ≤ 1e-13 and the correction ≤ 1e-6
//       ‖S⁻¹x‖∞
#pragma once

#include <utility>

#include "kernels/numbers/inverse_sqrt.hpp"
#include "kernels/step/model_view.hpp"

namespace tangere::kernels {

/// Full factors of at most so many rows have loops of fixed length. Their operations are those of
/// the lists, in the same order.
inline constexpr int kFixedRows = 12;

/// Calls f with the number of rows as a constant, if the factor of a part is full and small.
/// Returns whether it is.
template <int n = kFixedRows, class F>
bool with_fixed_rows(const Pattern& p, const PatternPart& part, const F& f) {
  if (n == kFixedRows && part.lower_begin[p.n] != p.n * (p.n - 1) / 2) return false;
  if (p.n == n) {
    f(std::make_integer_sequence<int, n>{});
    return true;
  }
  if constexpr (n > 2) return with_fixed_rows<n - 1>(p, part, f);
  return false;
}

/// Step k of the elimination of a full matrix of n rows.
template <int n, int k, class N>
void eliminate_column(N* work) {
  const N inverse = 1.0 / work[k * n + k];
  work[k * n + k] = inverse;
  N row[n];
  for (int j = k + 1; j < n; ++j) row[j] = work[k * n + j];
  for (int i = k + 1; i < n; ++i) {
    N* const to = work + i * n;
    const N l = to[k] * inverse;
    to[k] = l;
#pragma GCC unroll 12
    for (int j = k + 1; j < n; ++j) to[j] = mul_sub_from(l, row[j], to[j]);
  }
}

/// Factors in place, with unit lower factor. U's diagonal is stored as its reciprocal.
template <class N>
void eliminate(const Pattern& p, const PatternPart& part, N* work) {
  if (with_fixed_rows(
          p, part, [&]<int... k>(std::integer_sequence<int, k...>) {
            (eliminate_column<sizeof...(k), k>(work), ...);
          }))
    return;
  for (int k = 0; k < p.n; ++k) {
    const N inverse = 1.0 / work[p.diagonal[k]];
    work[p.diagonal[k]] = inverse;
    for (int c = part.lower_begin[k]; c < part.lower_begin[k + 1]; ++c) {
      const N l = work[part.lower_slot[c]] * inverse;
      work[part.lower_slot[c]] = l;
      for (int run = part.run_begin[c]; run < part.run_begin[c + 1]; ++run) {
        const EliminationRun& e = part.runs[run];
        const N* from = work + e.source;
        N* to = work + e.target;
        for (int r = 0; r < e.length; ++r) to[r] = mul_sub_from(l, from[r], to[r]);
      }
    }
  }
}

/// Factors A, whose numbers lie in `part`, into LU, (factor_entries): in all lanes if `accept` is
/// null, else in those where it is 1; the other lanes keep their LU. `work`: (factor_entries).
template <class N>
void factor(const Pattern& p, const PatternPart& part, const N* A, const N* accept, N* LU,
            N* work) {
  N* to = accept == nullptr ? LU : work;
  if (p.factor_entries != p.entries)
    for (int e = 0; e < p.factor_entries; ++e) to[e] = N(0.0);
  for (int e = 0; e < p.entries; ++e) to[p.scatter[e]] = A[e];
  eliminate(p, part, to);
  if (accept == nullptr) return;
  const auto mask = *accept > N(0.0);
  for (int e = 0; e < p.factor_entries; ++e) LU[e] = select(mask, work[e], LU[e]);
}

/// Returns b_k minus the products of factor slots begin … end - 1 with work, two sums at a time.
template <class N>
N reduced(const Pattern& p, const N* LU, int begin, int end, const N& b, const N* work) {
  N even = b, odd(0.0);
  int s = begin;
  for (; s + 1 < end; s += 2) {
    even = mul_sub_from(LU[s], work[p.factor_column[s]], even);
    odd = mul_sub_from(LU[s + 1], work[p.factor_column[s + 1]], odd);
  }
  if (s < end) even = mul_sub_from(LU[s], work[p.factor_column[s]], even);
  return even + odd;
}

/// The same of columns begin … end - 1 of a row of a full factor.
template <int begin, int end, class N>
N reduced_row(const N* row, const N& b, const N* work) {
  N even = b, odd(0.0);
#pragma GCC unroll 12
  for (int s = begin; s < end; ++s)
    ((s - begin) % 2 == 0 ? even : odd) =
        mul_sub_from(row[s], work[s], (s - begin) % 2 == 0 ? even : odd);
  return even + odd;
}

/// Solves x = A⁻¹ b from the factor, whose numbers lie in `part`. b and x are in dof order. `work`:
/// (n).
template <class N>
void solve(const Pattern& p, const PatternPart& part, const N* LU, const N* b, N* x, N* work) {
  if (with_fixed_rows(
          p, part, [&]<int... k>(std::integer_sequence<int, k...>) {
            constexpr int n = sizeof...(k), last = n - 1;
            N y[n];
            ((y[k] = reduced_row<0, k>(LU + n * k, b[p.permutation[k]], y)), ...);
            ((y[last - k] = reduced_row<last - k + 1, n>(LU + n * (last - k), y[last - k], y) *
                            LU[(n + 1) * (last - k)]),
             ...);
            for (int i = 0; i < n; ++i) x[p.permutation[i]] = y[i];
          }))
    return;
  for (int k = 0; k < p.n; ++k)
    work[k] = reduced(p, LU, part.factor_first[k], p.diagonal[k], b[p.permutation[k]], work);
  for (int k = p.n - 1; k >= 0; --k) {
    work[k] =
        reduced(p, LU, p.diagonal[k] + 1, part.factor_end[k], work[k], work) * LU[p.diagonal[k]];
    x[p.permutation[k]] = work[k];
  }
}

/// Solves x = A⁻ᵀ b from the same factor: Uᵀ, then Lᵀ, row by row of the factor.
template <class N>
void solve_transposed(const Pattern& p, const PatternPart& part, const N* LU, const N* b, N* x,
                      N* work) {
  const auto take = [&](int begin, int end, const N& y) {
    for (int s = begin; s < end; ++s)
      work[p.factor_column[s]] = mul_sub_from(LU[s], y, work[p.factor_column[s]]);
  };
  for (int k = 0; k < p.n; ++k) work[k] = b[p.permutation[k]];
  for (int k = 0; k < p.n; ++k) {
    work[k] = work[k] * LU[p.diagonal[k]];
    take(p.diagonal[k] + 1, part.factor_end[k], work[k]);
  }
  for (int k = p.n - 1; k >= 0; --k) {
    take(part.factor_first[k], p.diagonal[k], work[k]);
    x[p.permutation[k]] = work[k];
  }
}

/// Computes b - A x, or b - Aᵀ x.
template <bool Transposed, class N>
void defect(const Pattern& p, const PatternPart& part, const N* A, const N* x, const N* b, N* out) {
  if constexpr (Transposed) {
    for (int i = 0; i < p.n; ++i) out[i] = b[i];
    for (int i = 0; i < p.n; ++i)
      for (int e = part.entry_first[i]; e < part.entry_end[i]; ++e)
        out[p.entry_column[e]] = mul_sub_from(A[e], x[i], out[p.entry_column[e]]);
    return;
  }
  for (int i = 0; i < p.n; ++i) {
    N sum = b[i];
    for (int e = part.entry_first[i]; e < part.entry_end[i]; ++e)
      sum = mul_sub_from(A[e], x[p.entry_column[e]], sum);
    out[i] = sum;
  }
}

/// Returns the largest row sum of |S A S|; the largest column sum if transposed.
template <bool Transposed, class N>
N scaled_norm(const Pattern& p, const PatternPart& part, const N* A, const N* scale, N* sums) {
  N norm(0.0);
  for (int i = 0; i < p.n; ++i) sums[i] = N(0.0);
  for (int i = 0; i < p.n; ++i)
    for (int e = part.entry_first[i]; e < part.entry_end[i]; ++e) {
      N& sum = sums[Transposed ? p.entry_column[e] : i];
      sum = mul_add(abs(A[e]), scale[Transposed ? i : p.entry_column[e]], sum);
    }
  for (int i = 0; i < p.n; ++i) norm = max(sums[i] * scale[i], norm);
  return norm;
}

/// Solves x = A⁻¹ b or A⁻ᵀ b, refined once, in lanes whose factor is that of A, both with
/// their numbers in `part`. `sound` is 1 where the result passed the test above.
/// `work`: (5 n).
template <bool Transposed, class N>
void solve_watched(const Pattern& p, const PatternPart& part, const N* A, const N* LU, const N* b,
                   N* x, N* sound, N* work) {
  const int n = p.n;
  N *residual = work, *correction = work + n, *scale = work + 2 * n, *inverse_scale = work + 3 * n,
    *scratch = work + 4 * n;
  const N zero(0.0), one(1.0);
  const auto solve_for = [&](const N* from, N* to) {
    Transposed ? solve_transposed(p, part, LU, from, to, scratch)
               : solve(p, part, LU, from, to, scratch);
  };
  solve_for(b, x);
  defect<Transposed>(p, part, A, x, b, residual);
  solve_for(residual, correction);
  for (int i = 0; i < n; ++i) x[i] = x[i] + correction[i];
  defect<Transposed>(p, part, A, x, b, residual);
  for (int i = 0; i < n; ++i) {
    const N diagonal = abs(A[p.diagonal_entry[i]]);
    const N safe = select(diagonal > zero, diagonal, one);
    scale[i] = inverse_sqrt(safe);
    inverse_scale[i] = safe * scale[i];
  }
  const N norm_a = scaled_norm<Transposed>(p, part, A, scale, scratch);
  N norm_r = zero, norm_b = zero, norm_x = zero, norm_d = zero;
  for (int i = 0; i < n; ++i) {
    norm_r = max(abs(residual[i]) * scale[i], norm_r);
    norm_b = max(abs(b[i]) * scale[i], norm_b);
    norm_x = max(abs(x[i]) * inverse_scale[i], norm_x);
    norm_d = max(abs(correction[i]) * inverse_scale[i], norm_d);
  }
  // A NaN anywhere reaches x and fails this test of finiteness, because max() above drops it.
  N finite = zero;
  for (int i = 0; i < n; ++i) finite = mul_add(zero, x[i], finite);
  const auto ok = (norm_r <= 1e-13 * mul_add(norm_a, norm_x, norm_b)) & (norm_d <= 1e-6 * norm_x) &
                  (finite <= zero);
  *sound = select(ok, one, zero);
}

}  // namespace tangere::kernels
