// SPDX-License-Identifier: Apache-2.0
// The memory of friction at one row of a trajectory file.
#pragma once

#include <vector>

#include "engine/step/shear_state_arrays.hpp"

namespace tangere {

/// What friction remembered at a row, as the file holds it.
struct SavedMemory {
  std::vector<ShearSpringPlaces> contacts;
  std::vector<ShearState> environments;  ///< (E); points are rows of the file's arrays
};

}  // namespace tangere
