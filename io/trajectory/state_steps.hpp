// SPDX-License-Identifier: Apache-2.0
// Which rows of its states a trajectory file has.
#pragma once

#include <cstdint>
#include <vector>

#include "io/hdf5/h5.hpp"

namespace tangere {

/// Returns the steps of the run before each row of the states of a trajectory of `steps` steps: all
/// from 0 on, or those that the file lists. Throws IoError where its list is damaged.
std::vector<std::int64_t> state_steps(const h5::Id& file, std::int64_t steps);

}  // namespace tangere
