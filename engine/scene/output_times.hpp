// SPDX-License-Identifier: Apache-2.0
// When a run takes an output: as often as everything else, every so many steps, or at its end.
#pragma once

#include <cstdint>
#include <string>

namespace tangere {

/// When an output is taken. Rows are counted from 0: row t follows t steps of this run, and
/// `first` + t steps of the runs that it continues.
struct OutputTimes {
  std::int64_t every = 0;  ///< at steps that are a multiple of it; 0: at every row of the run
  bool final = false;      ///< at the last row alone

  [[nodiscard]] bool given() const { return every > 0 || final; }
  /// Whether it is taken at a row of a run whose last row is `last`. Without an interval: at each.
  [[nodiscard]] bool at(std::int64_t row, std::int64_t last, std::int64_t first = 0) const {
    if (final) return row == last;
    return every <= 0 || (first + row) % every == 0;
  }
  /// Number of rows below `row` at which it is taken.
  [[nodiscard]] std::int64_t before(std::int64_t row, std::int64_t last,
                                    std::int64_t first = 0) const {
    if (final) return row > last ? 1 : 0;
    if (every <= 0) return row;
    return (first + row + every - 1) / every - (first + every - 1) / every;
  }
  friend bool operator==(const OutputTimes&, const OutputTimes&) = default;
};

/// Returns "", "/10" or "/final": what stands behind the name of an output.
std::string to_string(const OutputTimes& times);

/// The name and the times of a word of --record or <outputs>: "pad", "pad/10", "q/final".
struct TimedName {
  std::string name;
  OutputTimes times;
};
/// Splits a word at its last '/'. Throws InputError where what follows is neither "final" nor a
/// whole number from 1 to 10⁹.
TimedName split_times(const std::string& word);

}  // namespace tangere
