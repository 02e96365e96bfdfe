// SPDX-License-Identifier: Apache-2.0
// Which bodies sleep at each row of a trajectory file: /sleep (docs/files.md).
#pragma once

#include <optional>

#include "io/hdf5/h5.hpp"
#include "io/trajectory/saved_sleep.hpp"

namespace tangere {

/// Reads row `at` of the `rows` rows of /q; no value: the file has no sleep state. Throws IoError
/// if a shape is damaged; Batch::set_sleep() checks the numbers.
std::optional<SavedSleep> read_sleep(const h5::Id& file, std::int64_t at, std::size_t rows,
                                     int environments);

}  // namespace tangere
