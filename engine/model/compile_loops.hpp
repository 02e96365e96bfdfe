// SPDX-License-Identifier: Apache-2.0
// Closed loops of links (kernels::Loop). Steps of compile().
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/model/name_index.hpp"

namespace tangere {

/// Fills CompiledModel::loops, after the initial state. Throws InputError (file:line) for a body
/// that is unknown, or two that cannot move against each other.
void compile_loops(CompiledModel& m, const NameIndex& bodies);

/// Makes row `row` of the block the source of a number of a loop.
void vary_loop(CompiledModel& m, const RandomizationDescription& d, int row);

}  // namespace tangere
