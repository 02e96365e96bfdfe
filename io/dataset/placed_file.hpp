// SPDX-License-Identifier: Apache-2.0
// A file that is written at given addresses in any order, in few large writes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/files/part_file.hpp"
#include "io/hdf5/h5_objects.hpp"

namespace tangere {

class PlacedFile {
 public:
  explicit PlacedFile(PartFile& part) : part_(part) {}

  /// Adds bytes, which must stay valid until flush(). Addresses must ascend between two calls of
  /// flush().
  void add(std::uint64_t address, std::span<const unsigned char> bytes, const BytesOf& what);
  /// Writes what was added. Gaps of less than eight bytes become zeros.
  void flush();

  /// Sets the end of the file in the library and, unless `root` is h5::kNowhere, the address of its
  /// group "/".
  void end_at(std::uint64_t end, std::uint64_t root = h5::kNowhere);

 private:
  PartFile& part_;
  std::vector<NamedBytes> queue_;
  std::uint64_t queue_begin_ = 0, queue_end_ = 0;
};

}  // namespace tangere
