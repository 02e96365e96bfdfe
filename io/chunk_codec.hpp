// SPDX-License-Identifier: Apache-2.0
// Chunks as HDF5's filters shuffle and deflate would make them, but by any thread: the library itself has one lock for all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/dataset_layout.hpp"
#include "io/h5_objects.hpp"

namespace tangere {

/// Deflate's level; shuffled tactile fields, zeros mostly, gain little from higher ones.
inline constexpr int kDeflateLevel = 1;

/// Rows of a chunk of each observation; 0: contiguous, where there is no compression or a row is too small for it. A power of two,
/// so that pieces of episodes hold whole chunks.
std::vector<std::int64_t> chunk_rows(const DatasetLayout& layout);
/// Whether the one row of final_obs is compressed as well.
bool compresses_last_row(std::size_t row_bytes);

/// What a file says of its chunks, numbers of `number_bytes` each.
std::vector<h5::FileFilter> file_filters(const std::string& compression, std::size_t number_bytes);
/// `used` bytes of data in a chunk of `bytes`, the rest of it zeros. Thread-safe.
std::vector<unsigned char> compressed(const DatasetLayout& layout, const unsigned char* data, std::size_t used,
                                      std::size_t bytes);

/// HDF5's shuffle: byte 0 of all numbers, then byte 1 of all …. `out` has room for all of them; numbers from `used` bytes on are
/// zeros. `width`: bytes of a number.
void shuffle(const unsigned char* data, std::size_t used, std::size_t width, std::vector<unsigned char>& out);

}  // namespace tangere
