// SPDX-License-Identifier: Apache-2.0
// The checksum `content_sum` of the numbers of a data set. Zeros of a row add nothing to it, so
// tiles that are not stored need not be read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace tangere {

/// A sum over the 32-bit words of a row, each times a factor of its place, modulo 2⁶⁴. Parts of
/// the row may be added in any order. Parts of zeros may be left out.
class RowSum {
 public:
  /// Adds bytes that begin at byte `offset` of the row, a multiple of 4. Their count is one, too,
  /// unless they end the row: then zeros fill the last word.
  void add(std::size_t offset, std::span<const unsigned char> bytes);
  [[nodiscard]] std::uint64_t value() const { return sum_; }

 private:
  std::uint64_t sum_ = 0;
};

/// A checksum that does not depend on order: the sum over rows of a hash of (episode, name, row,
/// numbers). Rows may be written in any order and read back in another.
class ContentSum {
 public:
  /// `whole_rows`: as up to format_version 5, where zeros were hashed as well.
  explicit ContentSum(bool whole_rows = false) : whole_rows_(whole_rows) {}

  /// `name` numbers the dataset: 0 actions, then the observations. `rows` rows of `row_bytes` each.
  void add(std::int64_t episode, std::size_t name, std::int64_t first_row, std::int64_t rows,
           std::size_t row_bytes, const void* data);
  /// Adds a row whose numbers have this sum. Not with `whole_rows`.
  void add(std::int64_t episode, std::size_t name, std::int64_t row, std::size_t row_bytes,
           const RowSum& numbers);
  void add(const ContentSum& other) { sum_ += other.sum_; }
  [[nodiscard]] std::uint64_t value() const { return sum_; }

 private:
  bool whole_rows_;
  std::uint64_t sum_ = 0;
};

/// Whether one of the bytes is not 0.
bool any_bit(std::span<const unsigned char> bytes);
/// Whether one of the numbers is not 0; -0 is 0. T: float, double.
template <class T>
bool any_number(std::span<const T> numbers);

}  // namespace tangere
