// SPDX-License-Identifier: Apache-2.0
// In-memory sequence of the tactile fields of a run.
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
