// SPDX-License-Identifier: Apache-2.0
// Anchors of points with shear springs and of joints with dry friction, from the state in which a
// solve begins.
#pragma once

#include "engine/step/workspace.hpp"

namespace tangere {

/// Prepares a solve that begins at q0 with w.shear.now: poses there, and anchors on the ground and
/// of joints. Those of lists are dropped.
template <int L>
void begin_shear(const CompiledModel& model, const kernels::KernelTable& table,
                 BasicWorkspace<L>& w);

/// Computes the anchors of the points that `lanes` have listed, where they are not those of the
/// present solve.
template <int L>
void set_list_anchors(const CompiledModel& model, const kernels::KernelTable& table,
                      BasicWorkspace<L>& w, LaneBits lanes);

}  // namespace tangere
