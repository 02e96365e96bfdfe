// SPDX-License-Identifier: Apache-2.0
// Densities, sizes and places that vary by environment, and what follows from them: the last steps
// of compile(), and for each episode of a batch.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Lets a number of a body, or of where a joint stands, come from row `row` of the block. Throws
/// InputError where it cannot.
void vary_body(CompiledModel& m, int body, const RandomizationDescription& d, int row);
void vary_place(CompiledModel& m, int joint, const RandomizationDescription& d, int row);

/// Once all varying numbers are known: rows, from `next`, for what kernels read instead of them.
/// Returns the row after.
int add_derived_rows(CompiledModel& m, int next);

/// Writes those rows of a lane from its numbers; `column`: row r is column[16 r].
void update_derived_rows(const CompiledModel& m, double* column);

}  // namespace tangere
