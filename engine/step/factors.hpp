// SPDX-License-Identifier: Apache-2.0
// Factors and solves of the lanes of a group: all at once on the scene's pattern, or lane by lane
// in blocks.
#pragma once

#include "engine/step/workspace.hpp"

namespace tangere {

inline bool in_blocks(const CompiledModel& m) { return m.view.pattern.slot == nullptr; }

/// Sets followers' numbers of a solution x = G y, in lanes from `first` to `end`. Those that follow
/// by polynomials keep 0: kinematics() sets their x itself.
template <int L>
void expand_followers(const CompiledModel& m, kernels::Row<L>* x, int first = 0, int end = L) {
  for (const kernels::Follower& f : m.followers)
    for (int l = first; l < end; ++l) x[f.v][l] = 0;
  for (const kernels::FollowerTie& t : m.ties)
    for (int l = first; l < end; ++l) x[t.v][l] += t.ratio * x[t.leader_v][l];
}
/// Sets those too, of a change x of the stage's x.
template <int L>
void expand_polynomials(const CompiledModel& m, const kernels::Stage<L>& stage,
                        kernels::Row<L>* x) {
  for (const kernels::PolynomialFollower& f : m.polynomials)
    for (int l = 0; l < L; ++l) {
      const double q = stage.centre[f.leader_q][l] + stage.x[f.leader_v][l];
      x[f.v][l] = kernels::polynomial_at(f.coefficients, q).slope * x[f.leader_v][l];
    }
}
/// Turns a right-hand side b into Gᵀ b. Those that follow by polynomials have theirs by the
/// leader's x already.
template <int L>
void fold_followers(const CompiledModel& m, kernels::Row<L>* b) {
  for (const kernels::FollowerTie& t : m.ties)
    for (int l = 0; l < L; ++l) b[t.leader_v][l] += t.ratio * b[t.v][l];
  for (const kernels::Follower& f : m.followers)
    for (int l = 0; l < L; ++l) b[f.v][l] = 0;
  for (const kernels::PolynomialFollower& f : m.polynomials)
    for (int l = 0; l < L; ++l) {
      b[f.leader_v][l] += b[f.v][l];
      b[f.v][l] = 0;
    }
}

/// Factors A of the lanes in `lanes`. Lanes in `kept` keep their factors.
template <int L>
void factor(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
            LaneBits lanes, LaneBits kept) {
  if (in_blocks(m)) {
    for (int l = 0; l < L; ++l)
      if (has(lanes, l))
        w.block_factors.factor(table, m.view.pattern, w.block_entries, w.stage.A, l);
    return;
  }
  kernels::Row<L> accept;
  for (int l = 0; l < L; ++l) accept[l] = has(lanes, l) ? 1 : 0;
  table.stage<L>().factor(m.view, w.stage, (kept & ~lanes) == 0 ? nullptr : &accept);
}

/// Solves out = A⁻¹ b by the present factors of `lanes`. b of followers is 0.
template <int L>
void solve(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
           LaneBits lanes, const kernels::Row<L>* b, kernels::Row<L>* out) {
  if (!in_blocks(m)) {
    table.stage<L>().solve(m.view, w.stage, b, out);
    return expand_followers(m, out);
  }
  for (int l = 0; l < L; ++l)
    if (has(lanes, l)) w.block_factors.solve(table, l, b, out);
}

/// Solves out = A⁻¹ b, or A⁻ᵀ b, refined once, in `lanes`. sound[l] = 1 where the result can be
/// trusted.
template <bool Transposed, int L>
void solve_watched(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                   LaneBits lanes, const kernels::Row<L>* b, kernels::Row<L>* out,
                   kernels::Row<L>& sound) {
  if (!in_blocks(m)) {
    const kernels::StageKernels<L>& k = table.stage<L>();
    (Transposed ? k.solve_transposed : k.solve_watched)(m.view, w.stage, b, out, &sound);
    return expand_followers(m, out);
  }
  for (int l = 0; l < L; ++l)
    if (has(lanes, l))
      sound[l] = w.block_factors.solve_watched(table, Transposed, l, b, out) ? 1 : 0;
}

/// Solves out = A⁻¹ b of one lane by its factor with row exchanges. b of followers is 0.
template <int L>
void solve_pivoted(const CompiledModel& m, BasicWorkspace<L>& w, int lane, const kernels::Row<L>* b,
                   kernels::Row<L>* out) {
  w.pivoted.solve(lane, b, out);
  expand_followers(m, out, lane, lane + 1);
}

/// Factors A of one lane, or Aᵀ, with row exchanges.
template <int L>
void factor_pivoted(const CompiledModel& m, BasicWorkspace<L>& w, int lane, bool transposed) {
  w.pivoted.factor(m.view.pattern, w.block_entries, w.stage.A, lane, transposed);
}

}  // namespace tangere
