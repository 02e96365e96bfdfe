// SPDX-License-Identifier: Apache-2.0
// q₁ ⊖ q₀ in lanes: the displacement from q₀ to q₁, by its right tangent.
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/step/rotation_log.hpp"

namespace tangere {

template <int L>
kernels::Quat<double> quat_at(const kernels::Row<L>* q, int lane) {
  return {q[0][lane], q[1][lane], q[2][lane], q[3][lane]};
}

/// Computes out = to ⊖ from: (nv) from (nq) each.
template <int L>
void state_difference(const CompiledModel& m, const kernels::Row<L>* to,
                      const kernels::Row<L>* from, kernels::Row<L>* out) {
  for (const kernels::Link& link : m.links) {
    for (int l = 0; l < L; ++l) {
      if (link.kind == kernels::JointKind::spherical) {
        const kernels::Vec3<double> x =
            rotation_log(conjugate(quat_at(from + link.q, l)) * quat_at(to + link.q, l));
        out[link.v][l] = x.x, out[link.v + 1][l] = x.y, out[link.v + 2][l] = x.z;
      } else {
        for (int k = 0; k < kernels::dofs(link.kind); ++k)
          out[link.v + k][l] = to[link.q + k][l] - from[link.q + k][l];
      }
    }
  }
}

}  // namespace tangere
