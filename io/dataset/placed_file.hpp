// SPDX-License-Identifier: Apache-2.0
// A file that is written in places, in any order, and read back afterwards: whether the disk has
// what it was given.
#pragma once

#include <sys/uio.h>

#include <cstdint>
#include <span>
#include <vector>

#include "io/dataset/shard_check.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5_objects.hpp"

namespace tangere {

/// Rows as ContentSum adds them.
struct PlacedRows {
  std::int64_t episode = 0;
  std::size_t name = 0;
  std::int64_t first_row = 0, rows = 0;
  std::size_t row_bytes = 0;
};

class PlacedFile {
 public:
  explicit PlacedFile(PartFile& part) : part_(part) {}

  /// Rows whose sum somebody else knows: expect() it. `data` must stay until flush(), as below.
  /// Places ascend until then.
  void add(std::uint64_t address, const PlacedRows& rows, const void* data);
  void expect(const ContentSum& sum) { expected_.add(sum); }
  /// Bytes of which nothing is known.
  void add(std::uint64_t address, std::span<const unsigned char> bytes);
  /// Writes what was added; gaps of less than eight bytes become zeros.
  void flush();

  /// At once; verify() does not look at it.
  void write_unchecked(std::uint64_t address, std::span<const unsigned char> bytes);

  /// Tells the library where the file ends, and where its group "/" is unless that leads nowhere;
  /// verify() does not look at it.
  void end_at(std::uint64_t end, std::uint64_t root = h5::kNowhere);

  /// Reads all that was written. Throws IoError when it is not the same.
  void verify() const;

 private:
  struct Place {
    std::uint64_t address;
    PlacedRows rows;
  };
  void queue(const Place& place, const void* data);

  PartFile& part_;
  std::vector<Place> places_;
  ContentSum expected_;
  std::vector<iovec> queue_;
  std::uint64_t queue_begin_ = 0, queue_end_ = 0;
};

}  // namespace tangere
