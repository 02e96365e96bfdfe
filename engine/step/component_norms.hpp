// SPDX-License-Identifier: Apache-2.0
// The norm of residuals (kernels/step/norms.hpp) of each component of a scene: bodies that neither
// joints nor contacts connect. The worst of them counts. One norm for all would hide what a light
// body lacks behind the forces on a heavy one that it never meets.
#pragma once

#include <cmath>
#include <limits>

#include "engine/step/workspace.hpp"

namespace tangere {

/// Sets the floors of the lanes in `lanes` from A.
template <int L>
void set_floors(const CompiledModel& m, BasicWorkspace<L>& w, LaneBits lanes) {
  const kernels::Pattern& p = m.view.pattern;
  for (int c = 0; c < m.components(); ++c) {
    kernels::Row<L> sum{};
    for (int k = m.component_begin[std::size_t(c)]; k < m.component_begin[std::size_t(c) + 1];
         ++k) {
      const int i = m.component_dofs[std::size_t(k)];
      const double scale =
          4 * std::numeric_limits<double>::epsilon() * m.unknown_scale[std::size_t(i)];
      const kernels::Row<L>& diagonal = w.stage.A[p.slot[i * p.n + i]];
      for (int l = 0; l < L; ++l) {
        const double ratio = w.stage.c0_over_h[l],
                     e = scale * (diagonal[l] * w.stage.inverse_weight[i][l] -
                                  ratio * ratio * w.stage.weight[i][l]);
        sum[l] += e * e;
      }
    }
    for (int l = 0; l < L; ++l)
      if (has(lanes, l)) w.floors[c][l] = sum[l];
  }
}

/// Computes the largest scaled residual of a component. A NaN in g is returned as NaN.
template <int L>
void worst_scaled_residuals(const CompiledModel& m, const BasicWorkspace<L>& w, double gravity,
                            kernels::Row<L>& out) {
  using Row = kernels::Row<L>;
  const kernels::Stage<L>& s = w.stage;
  out = Row{};
  for (int c = 0; c < m.components(); ++c) {
    Row residual{}, motion{}, mass{}, force{};
    for (int k = m.component_begin[std::size_t(c)]; k < m.component_begin[std::size_t(c) + 1];
         ++k) {
      const int i = m.component_dofs[std::size_t(k)];
      for (int l = 0; l < L; ++l) {
        const double r = s.inverse_weight[i][l] * s.g[i][l], v = s.weight[i][l] * s.v[i][l],
                     f = s.inverse_weight[i][l] * s.force_scale[i][l];
        residual[l] += r * r;
        motion[l] += v * v;
        mass[l] += s.weight[i][l] * s.weight[i][l];
        force[l] += f * f;
      }
    }
    for (int l = 0; l < L; ++l) {
      if (residual[l] <= w.floors[c][l]) continue;
      const double scale = std::sqrt(motion[l]) * s.c0_over_h[l] + gravity * std::sqrt(mass[l]) +
                           std::sqrt(force[l]);
      const double scaled = std::sqrt(residual[l]) / scale;
      if (!(scaled <= out[l])) out[l] = std::isnan(out[l]) ? out[l] : scaled;
    }
  }
}

}  // namespace tangere
