// SPDX-License-Identifier: Apache-2.0
// What friction remembers, in a trajectory file: /memory (docs/files.md).
#pragma once

#include <optional>

#include "engine/rows/row_sink.hpp"
#include "io/hdf5/h5.hpp"
#include "io/trajectory/saved_memory.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// Writes the rows of a file. The layout, which has points that remember, outlives it.
class MemoryRows {
 public:
  MemoryRows(const h5::Id& file, const TrajectoryLayout& layout);
  void write(const MemoryRow& row);
  [[nodiscard]] std::int64_t written() const { return written_; }

 private:
  const TrajectoryLayout& layout_;
  hsize_t together_ = 1;  // environments in a chunk
  h5::Id s_, step_;
  std::vector<double> numbers_;  // (together, points, 3)
  std::int64_t written_ = 0;
};

/// Returns what a file of `steps` steps remembers of its environments at `row`; none: it does not
/// hold that row.
/// `rows`: set to those that it holds. Throws IoError where it is damaged.
std::optional<SavedMemory> read_memory(const h5::Id& file, std::int64_t steps, int environments,
                                       std::int64_t row, std::vector<std::int64_t>& rows);

/// Reads steps of a run of `steps` steps, (n). Throws IoError unless they ascend.
std::vector<std::int64_t> read_steps(const h5::Id& dataset, std::int64_t steps);

}  // namespace tangere
