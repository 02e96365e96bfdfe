// SPDX-License-Identifier: Apache-2.0
// The memory of friction in the lanes of a workspace: anchors when a solve begins and lists are
// made, the memory after it when it has found its root.
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

/// A lane whose step is done, at q0, v0.
struct ReadingLane {
  std::int64_t steps = -1;      ///< of its episode until then; -1: it took none
  ShearState* shear = nullptr;  ///< all that it remembers
};
/// Advances the memory of sensors that are due to be read. `lanes`: (L).
template <int L>
void update_sensor_shear_state(const CompiledModel& model, const kernels::KernelTable& table,
                               BasicWorkspace<L>& w, std::span<const ReadingLane> lanes);

}  // namespace tangere
