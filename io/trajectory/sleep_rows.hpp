// SPDX-License-Identifier: Apache-2.0
// Which bodies sleep at each row of a trajectory file: /sleep (docs/files.md).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "engine/rows/row_sink.hpp"
#include "io/hdf5/h5.hpp"
#include "io/trajectory/saved_sleep.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// Rows of a compressed dataset (R, E, …), kept in memory until they fill a chunk: writing a part
/// of a chunk inflates and deflates all of it.
template <class T>
class RowsInChunks {
 public:
  RowsInChunks() = default;
  RowsInChunks(const h5::Id& group, const char* name, const h5::Dims& dims, const char* meaning);
  /// Numbers of the next row, (E, …), to be set before add_row().
  [[nodiscard]] std::span<T> next_row();
  /// Writes the chunk that the row fills, or the last row of all.
  void add_row();

 private:
  h5::Id dataset_;
  h5::Dims dims_;
  hsize_t chunk_rows_ = 1, first_ = 0, held_ = 0;  // rows: of a chunk, written, in memory
  std::vector<T> numbers_;                         // (chunk_rows, E, …)
};

/// Writes the rows of a file. The layout, which has trees that may sleep, outlives it.
class SleepRows {
 public:
  SleepRows(const h5::Id& file, const TrajectoryLayout& layout);
  /// The next row of /q.
  void write(const SleepRow& row);
  [[nodiscard]] std::int64_t written() const { return written_; }

 private:
  const TrajectoryLayout& layout_;
  RowsInChunks<std::int32_t> island_, rested_;  // (R, E, trees)
  RowsInChunks<double> u_, clearance_;          // (R, E, nu), (R, E)
  RowsInChunks<std::int8_t> resting_;           // (R, E)
  std::int64_t written_ = 0;
};

/// Reads row `at` of the `rows` rows of /q; none: the file does not hold who sleeps. Throws IoError
/// where a shape is damaged; Batch::set_sleep() checks the numbers.
std::optional<SavedSleep> read_sleep(const h5::Id& file, std::int64_t at, std::size_t rows,
                                     int environments);

}  // namespace tangere
