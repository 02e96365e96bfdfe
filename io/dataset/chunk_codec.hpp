// SPDX-License-Identifier: Apache-2.0
// Makes chunks as HDF5's filters shuffle, deflate and LZ4 would, but on any thread. The library
// itself has one lock for all threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/dataset/dataset_layout.hpp"
#include "io/hdf5/h5_objects.hpp"

namespace tangere {

/// Deflate's level. Shuffled tactile fields are mostly zeros and gain little from higher levels.
inline constexpr int kDeflateLevel = 1;

/// How an observation is cut into chunks.
struct ChunkPlan {
  std::int64_t rows = 0;  ///< of a chunk, a power of two: pieces hold whole chunks; 0: contiguous
  std::vector<std::uint64_t> tile;  ///< the part of a row in a chunk, or a row's shape
  bool may_be_absent = false;       ///< chunks of only zeros are left out
  bool last_row = false;            ///< the one row of final_obs is cut, too
  /// Readings of a row, over which the first dimension of the shape and of `tile` goes; 1: none.
  std::uint64_t window = 1;
};

/// Returns one plan per observation. An observation is contiguous if neither compression nor
/// sparseness is requested, and if its rows are too small for them.
std::vector<ChunkPlan> chunk_plans(const DatasetLayout& layout);
/// Whether any observation is cut. The size of an episode is then not known in advance.
bool has_chunks(const DatasetLayout& layout);
/// Whether any observation is cut into tiles, of which those of zeros are left out.
bool has_tiles(const DatasetLayout& layout);

/// The filters that a file declares for chunks of numbers of `number_bytes` each.
std::vector<h5::FileFilter> file_filters(const std::string& compression, std::size_t number_bytes);
/// Returns the bytes on disk of a chunk of `bytes`: `used` bytes of data, then zeros. `width`:
/// bytes of a number. Thread-safe.
std::vector<unsigned char> compressed(const DatasetLayout& layout, std::size_t width,
                                      const unsigned char* data, std::size_t used,
                                      std::size_t bytes);

/// Shuffles as HDF5 does: byte 0 of all numbers, then byte 1 of all, and so on. `out` has room for
/// all numbers. Numbers from `used` bytes on are zeros. `width`: bytes of a number.
void shuffle(const unsigned char* data, std::size_t used, std::size_t width,
             std::vector<unsigned char>& out);

}  // namespace tangere
