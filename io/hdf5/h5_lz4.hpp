// SPDX-License-Identifier: Apache-2.0
// Reads chunks that were compressed with LZ4. HDF5 itself does not have this filter.
#pragma once

#include <cstdint>

namespace tangere::h5 {

/// Lets the program read such chunks from now on. Thread-safe.
void allow_lz4();

/// While this lives, chunks that this thread reads have to unpack to so many bytes; 0: to any
/// number. The library takes a shorter chunk for a whole one and reads beyond its end.
class ExpectedChunk {
 public:
  explicit ExpectedChunk(std::uint64_t bytes);
  ~ExpectedChunk();
  ExpectedChunk(const ExpectedChunk&) = delete;
  ExpectedChunk& operator=(const ExpectedChunk&) = delete;
};

}  // namespace tangere::h5
