// SPDX-License-Identifier: Apache-2.0
// What friction remembers, in a trajectory file: /memory (docs/files.md).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "io/hdf5/h5.hpp"
#include "io/trajectory/saved_memory.hpp"

namespace tangere {

/// Returns what a file remembers of its environments at `row`; none: it does not
/// hold that row.
/// `rows`: set to those that it holds. Throws IoError where it is damaged.
std::optional<SavedMemory> read_memory(const h5::Id& file, int environments, std::int64_t row,
                                       std::vector<std::int64_t>& rows);

}  // namespace tangere
