// SPDX-License-Identifier: Apache-2.0
// A file that is written at given addresses in any order. It is read back afterwards to compare the
// disk with what was written.
#pragma once

#include <sys/uio.h>

#include <cstdint>
#include <span>
#include <vector>

#include "io/dataset/shard_check.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5_objects.hpp"

namespace tangere {

/// Rows as ContentSum identifies them.
struct PlacedRows {
  std::int64_t episode = 0;
  std::size_t name = 0;
  std::int64_t first_row = 0, rows = 0;
  std::size_t row_bytes = 0;
};

class PlacedFile {
 public:
  explicit PlacedFile(PartFile& part) : part_(part) {}

  /// Adds rows. The caller gives their checksum to expect(). `data` must stay valid until flush().
  /// Addresses must ascend between two calls of flush().
  void add(std::uint64_t address, const PlacedRows& rows, const void* data);
  void expect(const ContentSum& sum) { expected_.add(sum); }
  /// Adds bytes without a checksum of their own. They must also stay valid until flush().
  void add(std::uint64_t address, std::span<const unsigned char> bytes);
  /// Writes what was added. Gaps of less than eight bytes become zeros.
  void flush();

  /// Writes at once. verify() does not check these bytes.
  void write_unchecked(std::uint64_t address, std::span<const unsigned char> bytes);

  /// Tells the library where the file ends and, unless `root` is h5::kNowhere, where its group "/"
  /// is. verify() does not check this.
  void end_at(std::uint64_t end, std::uint64_t root = h5::kNowhere);

  /// Reads back all that was added. Throws IoError when it differs from what was written.
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
