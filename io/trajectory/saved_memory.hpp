// SPDX-License-Identifier: Apache-2.0
// The shear state at one row of a trajectory file.
#pragma once

#include <vector>

#include "engine/step/shear_state_arrays.hpp"

namespace tangere {

/// The shear state at a row as stored in the file.
struct SavedMemory {
  std::vector<ShearSpringPlaces> contacts;
  std::vector<ShearState> environments;  ///< (E); points are rows of the file's arrays
};

}  // namespace tangere
