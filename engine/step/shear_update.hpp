// SPDX-License-Identifier: Apache-2.0
// The shear state of the lanes of a workspace at the end of a solve.
#pragma once

#include <span>

#include "engine/step/workspace.hpp"

namespace tangere {

/// Sets w.shear.after of `lanes` from the solve's result in q1, v1.
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
