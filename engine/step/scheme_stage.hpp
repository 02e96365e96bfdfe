// SPDX-License-Identifier: Apache-2.0
// Sets centre, c₀, r, s and first guess of a stage in a workspace's rows (equations in
// engine/scene/scheme.hpp).
#pragma once

#include "engine/scene/scheme.hpp"
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
  for (int i = 0; i < m.nv; ++i)
    for (int l = 0; l < L; ++l) {
      double x_sum = row.r_before == 0 ? 0 : row.r_before * s.r[i][l];
      double v_sum = row.s_centre * w.v0[i][l];
      if (row.s_before != 0) v_sum += row.s_before * w.v_before[i][l];
      for (int j = 0; j < k; ++j) {
        const InnerWeight& inner = row.inner[std::size_t(j)];
        x_sum += inner.r * w.x_inner[j * m.nv + i][l];
        v_sum += inner.s * (w.v_inner[j * m.nv + i][l] - w.v0[i][l]);
      }
      s.r[i][l] = x_sum;
      s.s[i][l] = v_sum / row.s_divisor;
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
  for (int i = 0; i < m.nv; ++i)
    for (int l = 0; l < L; ++l) {
      const double way = share * h[l];
      if (k > 0) {
        s.x[i][l] += way * s.v[i][l];
      } else if (more == 0) {
        s.x[i][l] = way * w.v0[i][l];
      } else {
        s.x[i][l] = way * ((1 + more) * w.v0[i][l] - more * w.v_before[i][l]);
      }
    }
}

}  // namespace tangere
