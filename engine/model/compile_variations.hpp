// SPDX-License-Identifier: Apache-2.0
// Densities, sizes and positions that vary by environment, and the rows derived from them: the last
// steps of compile(), and an update for each episode of a batch.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Makes row `row` of the block the source of a number of a body or of a joint's place. Throws
/// InputError where that is not possible.
void vary_body(CompiledModel& m, int body, const RandomizationDescription& d, int row);
void vary_place(CompiledModel& m, int joint, const RandomizationDescription& d, int row);

/// Assigns rows, from `next` on, to the numbers that kernels read in place of the varying ones.
/// Call once all varying numbers are known. Returns the row after the last.
int add_derived_rows(CompiledModel& m, int next);

/// Computes those rows of a lane from its numbers. `column`: row r is column[16 r].
void update_derived_rows(const CompiledModel& m, double* column);

}  // namespace tangere
