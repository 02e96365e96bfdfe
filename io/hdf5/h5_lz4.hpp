// SPDX-License-Identifier: Apache-2.0
// Reads chunks that were compressed with LZ4. HDF5 itself does not have this filter.
#pragma once

#include <cstdint>

namespace tangere::h5 {

/// Registers the filter that reads such chunks. Thread-safe.
void allow_lz4();

/// The filter as H5Zregister() takes it, an H5Z_class2_t that stays. Another copy of the library in
/// this process, such as that of h5py, may register it for itself.
const void* lz4_filter();

/// RAII: chunks that this thread reads must unpack to exactly this number of bytes; 0: any. The
/// library does not check this and reads beyond the end of shorter chunks.
class ExpectedChunk {
 public:
  explicit ExpectedChunk(std::uint64_t bytes);
  ~ExpectedChunk();
  ExpectedChunk(const ExpectedChunk&) = delete;
  ExpectedChunk& operator=(const ExpectedChunk&) = delete;
};

}  // namespace tangere::h5
