// SPDX-License-Identifier: Apache-2.0
// Work on a piece of episodes before the single writing thread: checksums, compressed chunks, and
// rows with contact. Runs on any thread.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "io/dataset/content_sum.hpp"
#include "io/dataset/demo_format.hpp"

namespace tangere {

/// Rows as ContentSum identifies them.
struct PlacedRows {
  std::int64_t episode = 0;
  std::size_t name = 0;
  std::int64_t first_row = 0, rows = 0;
  std::size_t row_bytes = 0;
};

/// Rows of one dataset of one episode, as a piece has them.
struct PieceSlice {
  PlacedRows rows;         ///< none if the piece has nothing of the dataset
  std::int64_t first = 0;  ///< row of the dataset that comes first
  const unsigned char* data = nullptr;

  [[nodiscard]] std::span<const unsigned char> bytes() const {
    return {data, static_cast<std::size_t>(rows.rows) * rows.row_bytes};
  }
};

/// R of an episode of the piece. An episode that failed in its first action has no row. It gets
/// one, which readers skip.
std::int64_t rows_of_episode(const DatasetLayout& layout, const EpisodeRows& piece, int episode);

/// Slices of an episode of the piece, per dataset. Only tasks have rewards. Dones have no slice,
/// because they follow from R.
std::vector<PieceSlice> slices_of(const DemoFormat& format, const EpisodeRows& piece, int episode,
                                  std::int64_t rows);

struct PreparedChunk {
  int episode = 0;  ///< in the piece
  std::size_t dataset = 0;
  std::array<std::uint64_t, 4> first{};  ///< row, then the start of the tile
  std::vector<unsigned char> bytes;
};

/// Consecutive rows of a dataset of pictures, each a JPEG file.
struct PreparedPictures {
  int episode = 0;  ///< in the piece
  std::size_t dataset = 0;
  std::int64_t first = 0;  ///< row
  std::vector<std::vector<unsigned char>> files;
};

struct PreparedPiece {
  std::vector<ContentSum> sums;        ///< per episode
  std::vector<std::int64_t> touching;  ///< per episode: rows of obs with contact
  std::vector<PreparedChunk> chunks;
  std::vector<PreparedPictures> pictures;
};

/// Thread-safe.
PreparedPiece prepare_piece(const DatasetLayout& layout, const DemoFormat& format,
                            const EpisodeRows& piece);

}  // namespace tangere
