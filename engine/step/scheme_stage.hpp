// SPDX-License-Identifier: Apache-2.0
// What a stage of a scheme begins with, in a workspace's rows, by the equations at the head of
// engine/model/scheme.hpp.
#pragma once

#include "engine/model/scheme.hpp"
#include "engine/step/state_difference.hpp"
#include "engine/step/workspace.hpp"

namespace tangere {

/// Sets centre, c₀/h, r and s of stage `k` from the states and the earlier stages in the workspace.
/// `h`: the step of each lane [s].
template <int L>
void set_stage(const CompiledModel& m, const Scheme& scheme, int k, const kernels::Row<L>& h,
               BasicWorkspace<L>& w) {
  const SchemeStage& row = scheme.stages[std::size_t(k)];
  kernels::Stage<L>& s = w.stage;
  for (int l = 0; l < L; ++l) {
    s.c0_over_h[l] = row.c0 / h[l];
    s.inverse_h[l] = 1 / h[l];
  }
  for (int i = 0; i < m.nq; ++i) s.centre[i] = w.q0[i];
  if (row.r_before != 0) state_difference(m, w.q_before, w.q0, s.r);
  for (int i = 0; i < m.nv; ++i) {  // lanes innermost and without branches: these are vectors
    kernels::Row<L> by_x{}, by_v, v0 = w.v0[i];
    if (row.r_before != 0)
      for (int l = 0; l < L; ++l) by_x[l] = row.r_before * s.r[i][l];
    for (int l = 0; l < L; ++l) by_v[l] = row.s_centre * v0[l];
    if (row.s_before != 0)
      for (int l = 0; l < L; ++l) by_v[l] += row.s_before * w.v_before[i][l];
    for (int j = 0; j < k; ++j) {
      const InnerWeight& inner = row.inner[std::size_t(j)];
      for (int l = 0; l < L; ++l) {
        by_x[l] += inner.r * w.x_inner[j * m.nv + i][l];
        by_v[l] += inner.s * (w.v_inner[j * m.nv + i][l] - v0[l]);
      }
    }
    for (int l = 0; l < L; ++l) by_v[l] /= row.s_divisor;
    s.r[i] = by_x;
    s.s[i] = by_v;
  }
}

/// Sets the first guess of x: from the stage before, moved with its velocity; for the first stage,
/// from the start.
template <int L>
void guess_stage(const CompiledModel& m, const Scheme& scheme, int k, const kernels::Row<L>& h,
                 BasicWorkspace<L>& w) {
  kernels::Stage<L>& s = w.stage;
  const double end = scheme.stages[std::size_t(k)].end, more = scheme.extrapolation;
  const double share = k == 0 ? end : end - scheme.stages[std::size_t(k) - 1].end;
  kernels::Row<L> way;
  for (int l = 0; l < L; ++l) way[l] = share * h[l];
  for (int i = 0; i < m.nv; ++i) {
    kernels::Row<L> x = s.x[i];
    if (k > 0) {
      for (int l = 0; l < L; ++l) x[l] += way[l] * s.v[i][l];
    } else if (more == 0) {
      for (int l = 0; l < L; ++l) x[l] = way[l] * w.v0[i][l];
    } else {
      for (int l = 0; l < L; ++l)
        x[l] = way[l] * ((1 + more) * w.v0[i][l] - more * w.v_before[i][l]);
    }
    s.x[i] = x;
  }
}

}  // namespace tangere
