// SPDX-License-Identifier: Apache-2.0
// Chunks as HDF5's filters shuffle and deflate would make them, but by any thread: the library itself has one lock for all.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/episode_sink.hpp"
#include "io/dataset_layout.hpp"

namespace tangere {

/// Deflate's level; shuffled tactile fields, zeros mostly, gain little from higher ones.
inline constexpr int kDeflateLevel = 1;

/// Rows of a chunk of each observation; 0: contiguous, where there is no compression or a row is too small for it. A power of two,
/// so that pieces of episodes hold whole chunks.
std::vector<std::int64_t> chunk_rows(const DatasetLayout& layout);
/// Whether the one row of final_obs is compressed as well.
bool compresses_last_row(std::size_t row_bytes);

struct CompressedChunk {
  int episode = 0;       ///< in the piece
  std::size_t name = 0;  ///< observation
  std::int64_t row = 0;  ///< its first
  bool last = false;     ///< the row of final_obs
  std::vector<unsigned char> bytes;
};

/// All chunks of a piece. Thread-safe.
std::vector<CompressedChunk> compress(const DatasetLayout& layout, const std::vector<std::int64_t>& rows_of_chunks,
                                      const EpisodeRows& piece);

}  // namespace tangere
