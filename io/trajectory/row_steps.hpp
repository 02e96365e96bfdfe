// SPDX-License-Identifier: Apache-2.0
// Which steps the rows of a trajectory's channels belong to.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/hdf5/h5.hpp"

namespace tangere {

/// Opens a file of `tangere simulate`. Throws IoError for a file that is missing, damaged or none.
h5::Id open_trajectory(const std::string& path);
/// Whether an open file is one.
bool is_trajectory(const h5::Id& file);

/// Reads the attribute `steps`. Throws IoError for a damaged count.
std::int64_t steps_of_run(const h5::Id& file);

/// Returns the steps of the run before each row of a channel: "q", "tactile/pad/force". They are
/// listed below the same group where the channel has times of its own; else rows follow each step,
/// or begin at the start. Throws IoError unless they ascend from 0 on to the steps of the run.
std::vector<std::int64_t> row_steps(const h5::Id& file, const std::string& channel);

}  // namespace tangere
