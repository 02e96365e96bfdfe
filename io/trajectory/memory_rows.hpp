// SPDX-License-Identifier: Apache-2.0
// The shear state in a trajectory file: /memory (docs/files.md).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "io/hdf5/h5.hpp"
#include "io/trajectory/saved_memory.hpp"

namespace tangere {

/// Returns the shear states of all environments at `row` of a file; no value: the file does not
/// have that row. `rows`: set to the rows that it has. Throws IoError if it is damaged.
std::optional<SavedMemory> read_memory(const h5::Id& file, int environments, std::int64_t row,
                                       std::vector<std::int64_t>& rows);

}  // namespace tangere
