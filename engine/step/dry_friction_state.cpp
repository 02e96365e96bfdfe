// SPDX-License-Identifier: Apache-2.0
// Lane by lane: few joints have dry friction.
#include "engine/step/dry_friction_state.hpp"

namespace tangere {

template <int L>
void set_dry_anchors(const CompiledModel& m, BasicWorkspace<L>& w) {
  for (const DryDof& dof : m.dry_dofs) w.stage.dry_anchor[dof.v] = w.q0[dof.q];
  for (int l = 0; l < L; ++l)
    for (const ShearEntry& e : dry_entries(m, w.shear.now[std::size_t(l)]))
      w.stage.dry_anchor[dry_dof_of(m, e).v][l] -= e.s[0];
}

template <int L>
void append_dry_friction(const CompiledModel& m, BasicWorkspace<L>& w, LaneBits lanes) {
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    std::int32_t point = m.shear_spring_points;
    for (const DryDof& dof : m.dry_dofs) {
      const double s = w.q1[dof.q][l] - w.stage.dry_anchor[dof.v][l];
      const double hold = dry_friction_at_end(m, w, dof, w.v1, l).hold;
      w.shear.after[std::size_t(l)].push_back({point++, {hold * s, 0, 0}});
    }
  }
}

#define TANGERE_FOR_LANES(L)                                               \
  template void set_dry_anchors(const CompiledModel&, BasicWorkspace<L>&); \
  template void append_dry_friction(const CompiledModel&, BasicWorkspace<L>&, LaneBits);
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES

}  // namespace tangere
