// SPDX-License-Identifier: Apache-2.0
// Which bodies sleep at each row of a trajectory file: /sleep (docs/files.md).
#pragma once

#include <optional>
#include <vector>

#include "engine/rows/row_sink.hpp"
#include "io/hdf5/h5.hpp"
#include "io/trajectory/saved_sleep.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// Writes the rows of a file. The layout, which has trees that may sleep, outlives it.
class SleepRows {
 public:
  SleepRows(const h5::Id& file, const TrajectoryLayout& layout);
  /// `at`: row of /q.
  void write(std::int64_t at, const SleepRow& row);

 private:
  const TrajectoryLayout& layout_;
  h5::Id island_, rested_, controls_, clearance_, resting_;
  std::vector<std::int32_t> islands_, rests_;  // (E, trees)
  std::vector<double> u_, clearances_;         // (E, nu), (E)
  std::vector<std::int8_t> flags_;             // (E)
};

/// Reads row `at` of the `rows` rows of /q; none: the file does not hold who sleeps. Throws IoError
/// where a shape is damaged; Batch::set_sleep() checks the numbers.
std::optional<SavedSleep> read_sleep(const h5::Id& file, std::int64_t at, std::size_t rows,
                                     int environments);

}  // namespace tangere
