// SPDX-License-Identifier: Apache-2.0
// Rows of observations as a dict of arrays, each divided by its scale.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/rows/task_spec.hpp"
#include "python/module/arrays.hpp"

namespace tangere::python {

/// Returns KEY → new float32 array (environments, …) of `rows`, (environments, observation). All
/// keys, or those listed; InputError for one that the task does not have.
nb::dict observation_arrays(const TaskSpec& spec, std::span<const double> rows,
                            std::size_t environments, bool scaled,
                            const std::optional<std::vector<std::string>>& keys);

/// Scale of number `i` of an observation, by its place on the last axis; 1 where none is declared.
double scale_of(const TensorSpec& tensor, std::size_t i);

}  // namespace tangere::python
