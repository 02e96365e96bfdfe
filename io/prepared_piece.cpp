// SPDX-License-Identifier: Apache-2.0
// The numbers that ContentSum gives datasets: 0 actions, then observations, then rewards of tasks.
#include "io/prepared_piece.hpp"

#include <algorithm>
#include <stdexcept>

#include "io/chunk_codec.hpp"

namespace tangere {
namespace {

std::size_t size(std::int64_t n) { return static_cast<std::size_t>(n); }

const unsigned char* bytes_at(const EpisodeRows& piece, std::size_t name) {
  return std::visit([](const auto& values) { return reinterpret_cast<const unsigned char*>(values.data()); },
                    piece.observations[name]);
}

void add_observation(const DemoFormat& format, const EpisodeRows& piece, int episode, std::int64_t rows, std::size_t name,
                     std::vector<PieceSlice>& slices) {
  const std::int64_t taken = std::min<std::int64_t>(piece.action_rows, rows - piece.first_row);
  const std::size_t bytes = format.row_bytes(format.obs(name));
  const unsigned char* const data = bytes_at(piece, name) + size(episode) * size(piece.rows) * bytes;
  const std::int64_t number = piece.first_episode + episode;
  slices[format.obs(name)] = {{number, name + 1, piece.first_row, taken, bytes}, piece.first_row, data};
  if (piece.rows > taken)
    slices[format.final_obs(name)] = {{number, name + 1, piece.first_row + taken, 1, bytes}, 0, data + size(taken) * bytes};
}

}  // namespace

std::int64_t rows_of_episode(const DatasetLayout& layout, const EpisodeRows& piece, int episode) {
  return piece.ends.empty() ? layout.rows() : std::max<std::int64_t>(1, piece.ends[size(episode)].length);
}

std::vector<PieceSlice> slices_of(const DemoFormat& format, const EpisodeRows& piece, int episode, std::int64_t rows) {
  std::vector<PieceSlice> slices(format.datasets());
  const std::int64_t taken = std::min<std::int64_t>(piece.action_rows, rows - piece.first_row);
  const std::int64_t number = piece.first_episode + episode;
  const std::size_t bytes = format.row_bytes(DemoFormat::kActions);
  const auto* const actions = reinterpret_cast<const unsigned char*>(piece.actions.data());
  slices[DemoFormat::kActions] = {{number, 0, piece.first_row, taken, bytes},
                                  piece.first_row,
                                  actions + size(episode) * size(piece.action_rows) * bytes};
  if (!piece.ends.empty())
    slices[DemoFormat::kRewards] = {
        {number, format.observations() + 1, 0, rows, sizeof(float)},
        0,
        reinterpret_cast<const unsigned char*>(piece.rewards.data() + size(episode) * size(piece.action_rows))};
  for (std::size_t name = 0; name < format.observations(); ++name)
    add_observation(format, piece, episode, rows, name, slices);
  return slices;
}

PreparedPiece prepare_piece(const DatasetLayout& layout, const DemoFormat& format, const EpisodeRows& piece) {
  PreparedPiece prepared;
  prepared.sums.resize(size(piece.episodes));
  for (int e = 0; e < piece.episodes; ++e) {
    const std::int64_t rows = rows_of_episode(layout, piece, e);
    const std::vector<PieceSlice> slices = slices_of(format, piece, e, rows);
    for (std::size_t dataset = 0; dataset < slices.size(); ++dataset) {
      const PlacedRows& r = slices[dataset].rows;
      if (r.rows == 0) continue;
      prepared.sums[size(e)].add(r.episode, r.name, r.first_row, r.rows, r.row_bytes, slices[dataset].data);
      const std::int64_t each = format.chunk_rows(dataset, rows), first = slices[dataset].first;
      if (each == 0) continue;
      if (first % each != 0) throw std::logic_error("a piece begins within a chunk");
      for (std::int64_t row = 0; row < r.rows; row += each)
        prepared.chunks.push_back({e, dataset, first + row,
                                   compressed(layout, slices[dataset].data + size(row) * r.row_bytes,
                                              size(std::min(each, r.rows - row)) * r.row_bytes, size(each) * r.row_bytes)});
    }
  }
  return prepared;
}

}  // namespace tangere
