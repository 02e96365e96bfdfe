// SPDX-License-Identifier: Apache-2.0
// Shear state in the lanes of a workspace: computes anchors at the start of a solve and after each
// detection, and the updated shear state after convergence.
#pragma once

#include <span>

#include "engine/step/workspace.hpp"

namespace tangere {

/// Prepares a solve that begins at q0 with w.memory.now: poses there, and anchors on the ground.
template <int L>
void begin_shear(const CompiledModel& model, const kernels::KernelTable& table,
                 BasicWorkspace<L>& w);

/// Computes the anchors of the points that lane `lane` has listed for pair k.
template <int L>
void set_list_anchors(const CompiledModel& model, const kernels::KernelTable& table,
                      BasicWorkspace<L>& w, int k, int lane);

/// Sets w.memory.after of `lanes` from the solve's result in q1, v1.
template <int L>
void update_shear_state(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes);

/// A lane after its step, with the state in q0, v0.
struct ReadingLane {
  std::int64_t steps = -1;      ///< of its episode until then; -1: it took none
  ShearState* shear = nullptr;  ///< of the lane's environment
};
/// Updates the shear state of sensors that are due to be read. `lanes`: (L).
template <int L>
void update_sensor_shear_state(const CompiledModel& model, const kernels::KernelTable& table,
                               BasicWorkspace<L>& w, std::span<const ReadingLane> lanes);

}  // namespace tangere
