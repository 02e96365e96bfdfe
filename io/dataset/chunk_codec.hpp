// SPDX-License-Identifier: Apache-2.0
// Makes chunks as HDF5's filters shuffle, deflate and LZ4 would, but on any thread. The library has
// one lock for all threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/dataset/dataset_layout.hpp"
#include "io/hdf5/h5_objects.hpp"

namespace tangere {

/// Deflate's level; shuffled tactile fields, zeros mostly, gain little from higher ones.
inline constexpr int kDeflateLevel = 1;

/// How an observation is cut.
struct ChunkPlan {
  std::int64_t rows = 0;  ///< of a chunk, a power of two, so that pieces of episodes hold whole
                          ///< chunks; 0: contiguous
  std::vector<std::uint64_t> tile;  ///< of a row: its shape, or a part of it
  bool may_be_absent = false;       ///< chunks that hold zeros alone are left out
  bool last_row = false;            ///< the one row of final_obs is cut as well
};

/// One plan for each observation. It is contiguous without compression and sparseness, and where a
/// row is too small for them.
std::vector<ChunkPlan> chunk_plans(const DatasetLayout& layout);
/// Whether any observation is cut. Then the size of an episode is not known beforehand.
bool has_chunks(const DatasetLayout& layout);

/// The filters that a file declares for chunks of numbers of `number_bytes` each.
std::vector<h5::FileFilter> file_filters(const std::string& compression, std::size_t number_bytes);
/// Returns the bytes on disk of a chunk of `bytes`: `used` bytes of data, then zeros. Thread-safe.
std::vector<unsigned char> compressed(const DatasetLayout& layout, const unsigned char* data,
                                      std::size_t used, std::size_t bytes);

/// HDF5's shuffle: byte 0 of all numbers, then byte 1 of all …. `out` has room for all of them;
/// numbers from `used` bytes on are zeros. `width`: bytes of a number.
void shuffle(const unsigned char* data, std::size_t used, std::size_t width,
             std::vector<unsigned char>& out);

}  // namespace tangere
