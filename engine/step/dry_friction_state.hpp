// SPDX-License-Identifier: Apache-2.0
// Elastic displacements of joints with dry friction (kernels/step/dry_friction.hpp), as entries of
// the shear state.
#pragma once

#include "engine/step/workspace.hpp"
#include "kernels/step/dry_friction.hpp"

namespace tangere {

/// Returns the entries of dofs with dry friction, the last of a shear state.
inline std::span<const ShearEntry> dry_entries(const CompiledModel& m,
                                               std::span<const ShearEntry> state) {
  std::size_t first = state.size();
  while (first > 0 && state[first - 1].point >= m.shear_spring_points) --first;
  return state.subspan(first);
}

inline const DryDof& dry_dof_of(const CompiledModel& m, const ShearEntry& entry) {
  return m.dry_dofs[std::size_t(entry.point - m.shear_spring_points)];
}

/// Sets the anchors of a solve that begins at q0 with w.shear.now.
template <int L>
void set_dry_anchors(const CompiledModel& model, BasicWorkspace<L>& w);

/// Returns the law of one lane at the end of a solve.
template <int L>
kernels::DryFriction<double> dry_friction_at_end(const CompiledModel& m, const BasicWorkspace<L>& w,
                                                 const DryDof& dof, const kernels::Row<L>* v,
                                                 int lane) {
  return kernels::dry_friction(m.dof_effects[std::size_t(dof.v)], w.q1[dof.q][lane], v[dof.v][lane],
                               w.stage.dry_anchor[dof.v][lane]);
}

/// Appends the entries at the end of a solve, q1 and v1, to w.shear.after.
template <int L>
void append_dry_friction(const CompiledModel& model, BasicWorkspace<L>& w, LaneBits lanes);

}  // namespace tangere
