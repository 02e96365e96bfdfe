// SPDX-License-Identifier: Apache-2.0
// The work on a piece of episodes that any thread can do before the one writing thread gets it:
// checksums and compressed chunks.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "io/dataset/demo_format.hpp"
#include "io/dataset/placed_file.hpp"

namespace tangere {

/// Rows of one dataset of one episode, as a piece has them.
struct PieceSlice {
  PlacedRows rows;         ///< none where the piece has nothing of the dataset
  std::int64_t first = 0;  ///< row of the dataset that they begin with
  const unsigned char* data = nullptr;
};

/// R of an episode of the piece. An episode that failed in its first action has no row. It gets
/// one, which no reader will see.
std::int64_t rows_of_episode(const DatasetLayout& layout, const EpisodeRows& piece, int episode);

/// Of an episode of the piece, per dataset. Rewards only of tasks, dones never: those follow from
/// R.
std::vector<PieceSlice> slices_of(const DemoFormat& format, const EpisodeRows& piece, int episode,
                                  std::int64_t rows);

struct PreparedChunk {
  int episode = 0;  ///< in the piece
  std::size_t dataset = 0;
  std::array<std::uint64_t, 3> first{};  ///< row, then where the tile begins
  std::vector<unsigned char> bytes;
};

struct PreparedPiece {
  std::vector<ContentSum> sums;  ///< per episode
  std::vector<PreparedChunk> chunks;
};

/// Thread-safe.
PreparedPiece prepare_piece(const DatasetLayout& layout, const DemoFormat& format,
                            const EpisodeRows& piece);

}  // namespace tangere
