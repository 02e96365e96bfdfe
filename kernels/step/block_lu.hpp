// SPDX-License-Identifier: Apache-2.0
// LU in blocks of one environment, eight rows of a block at a time, without pivoting between or
// within blocks, and a solve that checks its result as lu.hpp does.
//
// A = L U with L(k, k) = 1. Block (k, k) of the factor holds U(k, k)⁻¹.
#pragma once

#include <cmath>

#include "kernels/numbers/one_lane.hpp"
#include "kernels/step/block_lu_types.hpp"

namespace tangere::kernels {

/// Replaces a block (n, n) by its inverse: Gauss and Jordan, without pivoting.
template <class A>
void invert_block(double* D, int n, int padded) {
  using N = Lanes<A>;
  for (int k = 0; k < n; ++k) {
    double* pivot = D + k * padded;
    const double inverse = 1.0 / pivot[k];
    pivot[k] = 0;  // row k is not eliminated by itself
    for (int j = 0; j < n; ++j) {
      double* column = D + j * padded;
      if (j == k) continue;
      const double share = column[k] * inverse;
      const N s(share);
      for (int r = 0; r < padded; r += kGroup)
        store_lanes(mul_sub_from(load_lanes<A>(pivot + r), s, load_lanes<A>(column + r)),
                    column + r);
      column[k] = share;
    }
    const N minus(-inverse);
    for (int r = 0; r < padded; r += kGroup)
      store_lanes(load_lanes<A>(pivot + r) * minus, pivot + r);
    pivot[k] = inverse;
  }
}

/// Computes eight rows of C ∓ L U: rows of `L` and `C` (·, padded), `inner` columns of L. `Inner`:
/// that number, or 0 where it is not known.
template <int Inner, bool Subtract, class A>
void multiply_rows(const double* L, int padded, const double* U, int padded_inner, int inner,
                   double* C, int columns) {
  using N = Lanes<A>;
  const int count = Inner > 0 ? Inner : inner;
  N left[Inner > 0 ? Inner : 1];
  for (int m = 0; m < Inner; ++m) left[m] = load_lanes<A>(L + m * padded);
  for (int c = 0; c < columns; ++c, C += padded, U += padded_inner) {
    N sum = Subtract ? load_lanes<A>(C) : N(0.0);
    for (int m = 0; m < count; ++m) {
      const N l = Inner > 0 ? left[Inner > 0 ? m : 0] : load_lanes<A>(L + m * padded);
      sum = Subtract ? mul_sub_from(l, N(U[m]), sum) : mul_add(l, N(U[m]), sum);
    }
    store_lanes(sum, C);
  }
}

/// Computes C -= L U, or C = L U, of blocks (rows, inner), (inner, columns) and (rows, columns).
template <bool Subtract, class A>
void multiply(const double* L, const BlockNode& rows, const double* U, const BlockNode& inner,
              double* C, const BlockNode& columns) {
  for (int r = 0; r < rows.padded; r += kGroup)
    if (inner.size == 6) {
      multiply_rows<6, Subtract, A>(L + r, rows.padded, U, inner.padded, 6, C + r, columns.size);
    } else {
      multiply_rows<0, Subtract, A>(L + r, rows.padded, U, inner.padded, inner.size, C + r,
                                    columns.size);
    }
}

/// Factors in place. `work`: a block of the two largest nodes.
template <class A>
void factor_blocks(const BlockPlan& p, double* LU, double* work) {
  const std::size_t* target = p.targets;
  for (int k = 0; k < p.n; ++k) {
    const BlockNode& node = p.nodes[k];
    double* inverse = LU + p.diagonal[k];
    invert_block<A>(inverse, node.size, node.padded);
    const EliminatedBlock *first = p.eliminated + p.begin[k], *end = p.eliminated + p.begin[k + 1];
    for (const EliminatedBlock* i = first; i != end; ++i) {
      const BlockNode& row = p.nodes[i->node];
      multiply<false, A>(LU + i->l, row, inverse, node, work, node);
      for (int c = 0; c < node.size * row.padded; c += kGroup)
        store_lanes(load_lanes<A>(work + c), LU + i->l + c);
      for (const EliminatedBlock* j = first; j != end; ++j)
        multiply<true, A>(LU + i->l, row, LU + j->u, node, LU + *target++, p.nodes[j->node]);
    }
  }
}

/// Computes y -= M x of a block (y.size, x.size), or y = M x.
template <bool Subtract, class A>
void times_block(const double* M, const BlockNode& rows, const double* x, int columns, double* y) {
  using N = Lanes<A>;
  for (int r = 0; r < rows.padded; r += kGroup) {
    N sum = Subtract ? load_lanes<A>(y + r) : N(0.0);
    for (int c = 0; c < columns; ++c) {
      const N m = load_lanes<A>(M + c * rows.padded + r), s(x[c]);
      sum = Subtract ? mul_sub_from(m, s, sum) : mul_add(m, s, sum);
    }
    store_lanes(sum, y + r);
  }
}
/// The same with Mᵀ, one number after the other.
template <bool Subtract, class A>
void times_transposed_block(const double* M, const BlockNode& rows, const double* x, int columns,
                            double* y) {
  using N = OneLane<A>;
  for (int c = 0; c < columns; ++c) {
    N sum = Subtract ? N(y[c]) : N(0.0);
    for (int r = 0; r < rows.size; ++r) {
      const N m(M[c * rows.padded + r]), s(x[r]);
      sum = Subtract ? mul_sub_from(m, s, sum) : mul_add(m, s, sum);
    }
    y[c] = sum.x;
  }
}

/// Solves A x = b, or Aᵀ x = b, from the factor. b and x are padded vectors, and may be the same.
template <bool Transposed, class A>
void solve_blocks(const BlockPlan& p, const double* LU, const double* b, double* x, double* work) {
  if (b != x)
    for (std::size_t i = 0; i < p.vector; ++i) x[i] = b[i];
  const auto multiply_inverse = [&](int k) {
    const BlockNode& node = p.nodes[k];
    if constexpr (Transposed) {
      times_transposed_block<false, A>(LU + p.diagonal[k], node, x + node.at, node.size, work);
    } else {
      times_block<false, A>(LU + p.diagonal[k], node, x + node.at, node.size, work);
    }
    for (int i = 0; i < node.size; ++i) x[node.at + std::size_t(i)] = work[i];
  };
  for (int k = 0; k < p.n; ++k) {
    const BlockNode& node = p.nodes[k];
    if constexpr (Transposed) multiply_inverse(k);
    for (int e = p.begin[k]; e < p.begin[k + 1]; ++e) {
      const EliminatedBlock& o = p.eliminated[e];
      const BlockNode& row = p.nodes[o.node];
      if constexpr (Transposed) {
        times_transposed_block<true, A>(LU + o.u, node, x + node.at, row.size, x + row.at);
      } else {
        times_block<true, A>(LU + o.l, row, x + node.at, node.size, x + row.at);
      }
    }
  }
  for (int k = p.n - 1; k >= 0; --k) {
    const BlockNode& node = p.nodes[k];
    for (int e = p.begin[k]; e < p.begin[k + 1]; ++e) {
      const EliminatedBlock& o = p.eliminated[e];
      const BlockNode& row = p.nodes[o.node];
      if constexpr (Transposed) {
        times_transposed_block<true, A>(LU + o.l, row, x + row.at, node.size, x + node.at);
      } else {
        times_block<true, A>(LU + o.u, node, x + row.at, row.size, x + node.at);
      }
    }
    if constexpr (!Transposed) multiply_inverse(k);
  }
}

/// Computes b - M x, or b - Mᵀ x, with M = A.
template <bool Transposed, class A>
void block_defect(const BlockPlan& p, const double* M, const double* x, const double* b,
                  double* out) {
  for (std::size_t i = 0; i < p.vector; ++i) out[i] = b[i];
  for (int k = 0; k < p.n_blocks; ++k) {
    const MatrixBlock& o = p.blocks[k];
    const BlockNode &row = p.nodes[o.row], &column = p.nodes[o.column];
    if constexpr (Transposed) {
      times_transposed_block<true, A>(M + o.at, row, x + row.at, column.size, out + column.at);
    } else {
      times_block<true, A>(M + o.at, row, x + column.at, column.size, out + row.at);
    }
  }
}

/// Returns the largest row sum of |S M S|; the largest column sum if transposed.
template <bool Transposed, class A>
double scaled_block_norm(const BlockPlan& p, const double* M, const double* scale, double* sums) {
  for (std::size_t i = 0; i < p.vector; ++i) sums[i] = 0;
  for (int k = 0; k < p.n_blocks; ++k) {
    const MatrixBlock& o = p.blocks[k];
    const BlockNode &row = p.nodes[o.row], &column = p.nodes[o.column];
    for (int c = 0; c < column.size; ++c) {
      const double* entries = M + o.at + c * row.padded;
      const std::size_t j = column.at + std::size_t(c);
      for (int r = 0; r < row.size; ++r) {
        const std::size_t i = row.at + std::size_t(r);
        sums[Transposed ? j : i] += std::fabs(entries[r]) * scale[Transposed ? i : j];
      }
    }
  }
  double norm = 0;
  for (std::size_t i = 0; i < p.vector; ++i) norm = max(sums[i] * scale[i], norm);
  return norm;
}

/// Solves A x = b or Aᵀ x = b, refined once. Returns whether the result passed the test of lu.hpp.
/// `work`: 5 vectors and a block.
template <bool Transposed, class A>
bool solve_blocks_watched(const BlockPlan& p, const double* M, const double* LU, const double* b,
                          double* x, double* work) {
  double *residual = work, *correction = work + p.vector, *scale = work + 2 * p.vector,
         *inverse_scale = work + 3 * p.vector, *sums = work + 4 * p.vector,
         *scratch = work + 5 * p.vector;
  solve_blocks<Transposed, A>(p, LU, b, x, scratch);
  block_defect<Transposed, A>(p, M, x, b, residual);
  solve_blocks<Transposed, A>(p, LU, residual, correction, scratch);
  for (std::size_t i = 0; i < p.vector; ++i) x[i] += correction[i];
  block_defect<Transposed, A>(p, M, x, b, residual);
  for (std::size_t i = 0; i < p.vector; ++i) scale[i] = inverse_scale[i] = 0;
  for (int k = 0; k < p.n_blocks; ++k) {
    const MatrixBlock& o = p.blocks[k];
    const BlockNode& node = p.nodes[o.row];
    for (int i = 0; o.row == o.column && i < node.size; ++i) {
      const double entry = std::fabs(M[o.at + std::size_t(i * (node.padded + 1))]),
                   root = std::sqrt(entry > 0 ? entry : 1.0);
      inverse_scale[node.at + std::size_t(i)] = root;
      scale[node.at + std::size_t(i)] = 1 / root;
    }
  }
  const double norm_a = scaled_block_norm<Transposed, A>(p, M, scale, sums);
  double norm_r = 0, norm_b = 0, norm_x = 0, norm_d = 0;
  bool finite = true;
  for (std::size_t i = 0; i < p.vector; ++i) {
    norm_r = max(std::fabs(residual[i]) * scale[i], norm_r);
    norm_b = max(std::fabs(b[i]) * scale[i], norm_b);
    norm_x = max(std::fabs(x[i]) * inverse_scale[i], norm_x);
    norm_d = max(std::fabs(correction[i]) * inverse_scale[i], norm_d);
    finite = finite && std::isfinite(x[i]);
  }
  return finite && norm_r <= 1e-13 * (norm_a * norm_x + norm_b) && norm_d <= 1e-6 * norm_x;
}

}  // namespace tangere::kernels
