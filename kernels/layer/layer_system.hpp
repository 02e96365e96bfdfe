// SPDX-License-Identifier: Apache-2.0
// Linear system M P = δ̄ of the pressing cells of a layer (engine/layer/gel_layer.hpp), M symmetric
// and positive definite, by M = Uᵀ U. Rows are added to rows, number by number, so that the factor
// and the solution have the same bits on every instruction set.
//
// With the sums A_i of kernels/layer/layer_points.hpp, and m_i = Σ δδ_s/n_i over the n_i pressing
// points of a cell, the yield changes by δw_i = m_i - v/n_i (M⁻¹ m)_i, v = side² C(0). So
//   Σ A_i δw_i = Σ (A_i - v y_i) m_i,   M y = A_i/n_i
#pragma once

#include <cmath>

#include "kernels/layer/layer_types.hpp"

namespace tangere::kernels {

/// Returns Σ f(b), b < n, as eight sums that are added pair by pair, so that the order is the same
/// on every instruction set.
template <class A, class F>
double sum_of_products(int n, const F& f) {
  double sums[kGroup] = {};
  int b = 0;
  for (; b + kGroup <= n; b += kGroup)
    for (int l = 0; l < kGroup; ++l) sums[l] += f(b + l);
  for (int l = 0; b < n; ++b, ++l) sums[l] += f(b);
  for (int half = kGroup / 2; half > 0; half /= 2)
    for (int l = 0; l < half; ++l) sums[l] += sums[l + half];
  return sums[0];
}

/// Overwrites the upper triangle of M, (n, n), by U.
template <class A>
void factor_layer(double* U, int n) {
  const auto row = [&](int a) { return U + std::ptrdiff_t(a) * n; };
  for (int a = 0; a < n; ++a) {
    double* const u = row(a);
    const double inverse = 1 / std::sqrt(u[a]);
    for (int b = a; b < n; ++b) u[b] *= inverse;
    for (int b = a + 1; b < n; ++b) {
      double* const below = row(b);
      const double f = u[b];
      for (int c = b; c < n; ++c) below[c] -= f * u[c];
    }
  }
}

/// Solves M x = b in place.
template <class A>
void solve_layer(const double* U, int n, double* x) {
  const auto row = [&](int a) { return U + std::ptrdiff_t(a) * n; };
  for (int a = 0; a < n; ++a) {
    const double* const u = row(a);
    x[a] /= u[a];
    const double y = x[a];
    for (int b = a + 1; b < n; ++b) x[b] -= u[b] * y;
  }
  for (int a = n; a-- > 0;) {
    const double* const u = row(a);
    x[a] =
        (x[a] - sum_of_products<A>(n - a - 1, [&](int b) { return u[a + 1 + b] * x[a + 1 + b]; })) /
        u[a];
  }
}

/// Computes C x.
template <class A>
void couple_cells(const LayerProduct& s) {
  for (int i = 0; i < s.m; ++i) {
    const double* const row = s.table + std::ptrdiff_t(s.to[i]) * s.cells;
    s.out[s.to[i]] = sum_of_products<A>(s.n, [&](int b) { return row[s.from[b]] * s.x[b]; });
  }
}

/// Adds what the yield of the cells changes in the slopes of w.
template <class A>
void add_yield_slopes(const LayerSystem& s) {
  using N = Lanes<A>;
  const auto at = [&](int a) { return s.work + kCellWrench * a; };
  const auto cell = [&](int a) { return s.cells + kCellNumbers * s.cell[s.step * a]; };
  const auto row = [&](int a) { return s.factor + std::ptrdiff_t(a) * s.n; };
  for (int a = 0; a < s.n; ++a)
    store_lanes(N(1.0 / s.count[s.step * a]) * load_lanes<A>(cell(a)), at(a));
  // Four rows at a time: what is above them is read and written once.
  constexpr int kRows = 4;
  for (int a = 0; a < s.n; a += kRows) {
    const int end = a + kRows < s.n ? a + kRows : s.n;
    N x[kRows] = {};
    for (int i = a; i < end; ++i) {
      N y = load_lanes<A>(at(i));
      for (int k = a; k < i; ++k) y = mul_sub_from(N(row(k)[i]), x[k - a], y);
      x[i - a] = N(1 / row(i)[i]) * y;
      store_lanes(x[i - a], at(i));
    }
    for (int b = end; b < s.n; ++b) {
      N y = load_lanes<A>(at(b));
      for (int k = 0; k < kRows; ++k) y = mul_sub_from(N(row(a + k)[b]), x[k], y);
      store_lanes(y, at(b));
    }
  }
  for (int a = s.n; a-- > 0;) {
    const double* const u = row(a);
    N parts[kRows] = {load_lanes<A>(at(a)), N(0.0), N(0.0), N(0.0)};
    int b = a + 1;
    for (; b + kRows <= s.n; b += kRows)
      for (int k = 0; k < kRows; ++k)
        parts[k] = mul_sub_from(N(u[b + k]), load_lanes<A>(at(b + k)), parts[k]);
    for (; b < s.n; ++b) parts[0] = mul_sub_from(N(u[b]), load_lanes<A>(at(b)), parts[0]);
    store_lanes(N(1 / u[a]) * ((parts[0] + parts[1]) + (parts[2] + parts[3])), at(a));
  }
  N sums[6][2];
  for (auto& two : sums) two[0] = two[1] = N(0.0);
  for (int a = 0; a < s.n; ++a) {
    const double* const c = cell(a);
    const double inverse = 1.0 / s.count[s.step * a];
    const N m[2] = {load_lanes<A>(c + kCellWrench), load_lanes<A>(c + kCellWrench + kGroup)};
    for (int r = 0; r < 6; ++r) {
      const N w(inverse * (s.whole * at(a)[r] - c[r]));
      for (int h = 0; h < 2; ++h) sums[r][h] = mul_add(w, m[h], sums[r][h]);
    }
  }
  for (int r = 0; r < 6; ++r) {
    alignas(64) double x[2 * kGroup];
    store_lanes(sums[r][0], x), store_lanes(sums[r][1], x + kGroup);
    for (int k = 0; k < kLayerDirections; ++k) s.rows[kLayerDirections * r + k] += x[k];
  }
}

}  // namespace tangere::kernels
