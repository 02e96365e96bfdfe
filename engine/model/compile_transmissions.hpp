// SPDX-License-Identifier: Apache-2.0
// Transmissions (kernels::Transmission). Steps of compile().
#pragma once

#include <vector>

#include "engine/model/compiled_model.hpp"
#include "engine/model/name_index.hpp"

namespace tangere {

/// Fills CompiledModel::transmissions and their pieces and dofs. Throws InputError (file:line) for
/// a joint that stands for none, a path that has no two points, bodies that are unknown, and points
/// inside of what their path goes around.
void compile_transmissions(CompiledModel& m, const NameIndex& joints, const NameIndex& bodies);

/// Sets the initial state of transmissions. Throws InputError where the scene gives another one.
void place_initial_transmissions(CompiledModel& m);

/// Returns the dofs that each transmission drives.
std::vector<std::vector<int>> driven_dofs(const CompiledModel& m);

}  // namespace tangere
