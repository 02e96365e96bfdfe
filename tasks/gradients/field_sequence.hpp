// SPDX-License-Identifier: Apache-2.0
// Tactile fields of a run, in memory.
#pragma once

#include <cstdint>
#include <vector>

namespace tangere {

/// Fields of every sensor in turn, each (points, 3) [N]. readings[k] follows step
/// (k + 1) `every`.
struct FieldSequence {
  std::int64_t every = 1;
  std::vector<std::vector<double>> readings;
};

}  // namespace tangere
