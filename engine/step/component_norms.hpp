// SPDX-License-Identifier: Apache-2.0
// Maximum over the components of a scene of the residual norm (kernels/step/norms.hpp). A component
// is a set of bodies that joints and contacts connect. One norm for the whole scene would scale the
// residual of a light body by the forces on a heavy one that it never touches.
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
    for (const int i : dofs_of_component(m, c)) {
      const double scale =
          4 * std::numeric_limits<double>::epsilon() * m.unknown_scale[std::size_t(i)];
      const kernels::Row<L>& diagonal = w.stage.A[p.diagonal_entry[i]];
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
    for (const int i : dofs_of_component(m, c)) {
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
