// SPDX-License-Identifier: Apache-2.0
// ContentSum numbers the datasets: 0 for actions, then observations, then rewards of tasks, then
// derivatives, then samples.
#include "io/dataset/prepared_piece.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "engine/base/as_size.hpp"

namespace tangere {
namespace {

const unsigned char* bytes_at(const EpisodeRows& piece, std::size_t name) {
  return std::visit(
      [](const auto& values) { return reinterpret_cast<const unsigned char*>(values.data()); },
      piece.observations[name]);
}

void add_observation(const DemoFormat& format, const EpisodeRows& piece, int episode,
                     std::int64_t rows, std::size_t name, std::vector<PieceSlice>& slices) {
  const std::int64_t taken = std::min<std::int64_t>(piece.action_rows, rows - piece.first_row);
  const std::size_t bytes = format.row_bytes(format.obs(name));
  const unsigned char* const data =
      bytes_at(piece, format.source(name)) + as_size(episode) * as_size(piece.rows) * bytes;
  const std::int64_t number = piece.first_episode + episode;
  slices[format.obs(name)] = {
      {number, name + 1, piece.first_row, taken, bytes}, piece.first_row, data};
  if (piece.rows > taken)
    slices[format.final_obs(name)] = {
        {number, name + 1, piece.first_row + taken, 1, bytes}, 0, data + as_size(taken) * bytes};
}

void add_gradient(const DemoFormat& format, const EpisodeRows& piece, int episode,
                  std::int64_t rows, std::size_t k, std::vector<PieceSlice>& slices) {
  const std::span<const double> all = piece.gradients[format.source_of_gradient(k)];
  const std::size_t dataset = format.gradient(k), each = all.size() / as_size(piece.episodes);
  slices[dataset] = {{piece.first_episode + episode, format.observations() + 2 + k, 0,
                      format.rows_of(dataset, rows), format.row_bytes(dataset)},
                     0,
                     reinterpret_cast<const unsigned char*>(all.data() + as_size(episode) * each)};
}

/// `rows`: R, which all episodes of a scene have.
void add_sample(const DemoFormat& format, const EpisodeRows& piece, int episode, std::int64_t rows,
                std::size_t k, std::vector<PieceSlice>& slices) {
  const DatasetSample& sample = format.samples()[k];
  const std::size_t dataset = format.sample(k), bytes = format.row_bytes(dataset);
  const std::int64_t first = sample.times.before(piece.first_row, rows),
                     count = sample.times.before(piece.first_row + piece.rows, rows) - first;
  slices[dataset] = {{piece.first_episode + episode,
                      format.observations() + 2 + format.gradients() + k, first, count, bytes},
                     first,
                     bytes_at(piece, sample.source) + as_size(episode) * as_size(count) * bytes};
}

/// Layout of a dataset's rows: height × width cells each. A cell is a point of a field, or the
/// whole row.
struct Cells {
  std::size_t height = 1, width = 1, bytes = 0;  ///< of a cell
  std::size_t tile_height = 1, tile_width = 1;
  std::size_t rank = 0;  ///< of the tiles: 0 whole rows, 1 parts of a list, 2 of an image

  Cells(const std::vector<std::uint64_t>& shape, const std::vector<std::uint64_t>& tile,
        std::size_t row_bytes)
      : bytes(row_bytes) {
    if (shape == tile) return;
    rank = shape.size() - 1;
    width = shape[rank - 1];
    tile_width = tile[rank - 1];
    if (rank == 2) {
      height = shape[0];
      tile_height = tile[0];
    }
    bytes = row_bytes / (height * width);
  }
  [[nodiscard]] std::size_t row_bytes() const { return height * width * bytes; }
  [[nodiscard]] std::size_t tile_bytes() const { return tile_height * tile_width * bytes; }
  [[nodiscard]] std::array<std::uint64_t, 3> first(std::int64_t row, std::size_t r,
                                                   std::size_t c) const {
    if (rank == 2) return {static_cast<std::uint64_t>(row), r, c};
    return {static_cast<std::uint64_t>(row), c, 0};
  }
};

/// Cuts the tile that begins at row r, column c, from each of `rows` rows. Cells outside are zero.
void cut_tile(const Cells& cells, const unsigned char* data, std::size_t rows, std::size_t r,
              std::size_t c, std::vector<unsigned char>& out) {
  const std::size_t high = std::min(cells.tile_height, cells.height - r),
                    wide = std::min(cells.tile_width, cells.width - c);
  if (wide < cells.tile_width || high < cells.tile_height)
    std::fill(out.begin(), out.end(), static_cast<unsigned char>(0));
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t k = 0; k < high; ++k)
      std::memcpy(out.data() + row * cells.tile_bytes() + k * cells.tile_width * cells.bytes,
                  data + row * cells.row_bytes() + ((r + k) * cells.width + c) * cells.bytes,
                  wide * cells.bytes);
}

bool all_zero(const std::vector<unsigned char>& bytes) {
  return bytes.empty() ||
         (bytes[0] == 0 && std::memcmp(bytes.data(), bytes.data() + 1, bytes.size() - 1) == 0);
}

class Cutter {
 public:
  Cutter(const DatasetLayout& layout, const DemoFormat& format, std::vector<PreparedChunk>& chunks)
      : layout_(layout), format_(format), chunks_(chunks) {}

  /// `each`: rows of a chunk.
  void cut(int episode, std::size_t dataset, const PieceSlice& slice, std::int64_t each) {
    const Cells cells(format_.shape(dataset), format_.plan(dataset).tile, slice.rows.row_bytes);
    for (std::int64_t row = 0; row < slice.rows.rows; row += each) {
      const unsigned char* const data = slice.data + as_size(row) * cells.row_bytes();
      const std::size_t used = as_size(std::min(each, slice.rows.rows - row));
      for (std::size_t r = 0; r < cells.height; r += cells.tile_height)
        for (std::size_t c = 0; c < cells.width; c += cells.tile_width)
          add({episode, dataset, cells.first(slice.first + row, r, c), {}}, cells, data, used,
              as_size(each));
    }
  }

 private:
  void add(PreparedChunk chunk, const Cells& cells, const unsigned char* data, std::size_t used,
           std::size_t each) {
    const std::size_t r = cells.rank == 2 ? chunk.first[1] : 0,
                      c = chunk.first[cells.rank == 2 ? 2 : 1];
    if (cells.rank > 0) {
      tile_.resize(used * cells.tile_bytes());
      cut_tile(cells, data, used, r, c, tile_);
      if (format_.plan(chunk.dataset).may_be_absent && all_zero(tile_)) return;
      data = tile_.data();
    }
    chunk.bytes = compressed(layout_, data, used * cells.tile_bytes(), each * cells.tile_bytes());
    chunks_.push_back(std::move(chunk));
  }

  const DatasetLayout& layout_;
  const DemoFormat& format_;
  std::vector<PreparedChunk>& chunks_;
  std::vector<unsigned char> tile_;
};

/// Whether one of the numbers is not 0.
template <class T>
bool any(const unsigned char* bytes, std::size_t count) {
  const auto* const numbers = reinterpret_cast<const T*>(bytes);
  return std::any_of(numbers, numbers + count / sizeof(T), [](T x) { return x != T{0}; });
}

/// Rows of obs in which an observation that is touch is not all zero.
std::int64_t touching_rows(const DemoFormat& format, const std::vector<PieceSlice>& slices) {
  if (format.touch().empty()) return 0;
  const auto felt = [&](std::int64_t row, std::size_t name) {
    const PieceSlice& slice = slices[format.obs(name)];
    const std::size_t bytes = slice.rows.row_bytes;
    const unsigned char* const at = slice.data + as_size(row) * bytes;
    return format.single() ? any<float>(at, bytes) : any<double>(at, bytes);
  };
  std::int64_t count = 0;
  for (std::int64_t row = 0; row < slices[format.obs(format.touch()[0])].rows.rows; ++row)
    count += std::any_of(format.touch().begin(), format.touch().end(),
                         [&](std::size_t name) { return felt(row, name); });
  return count;
}

}  // namespace

std::int64_t rows_of_episode(const DatasetLayout& layout, const EpisodeRows& piece, int episode) {
  return piece.ends.empty() ? layout.rows()
                            : std::max<std::int64_t>(1, piece.ends[as_size(episode)].length);
}

std::vector<PieceSlice> slices_of(const DemoFormat& format, const EpisodeRows& piece, int episode,
                                  std::int64_t rows) {
  std::vector<PieceSlice> slices(format.datasets());
  const std::int64_t taken = std::min<std::int64_t>(piece.action_rows, rows - piece.first_row);
  const std::int64_t number = piece.first_episode + episode;
  const std::size_t bytes = format.row_bytes(DemoFormat::kActions);
  const auto* const actions = reinterpret_cast<const unsigned char*>(piece.actions.data());
  slices[DemoFormat::kActions] = {{number, 0, piece.first_row, taken, bytes},
                                  piece.first_row,
                                  actions + as_size(episode) * as_size(piece.action_rows) * bytes};
  if (!piece.ends.empty())
    slices[DemoFormat::kRewards] = {
        {number, format.observations() + 1, 0, rows, sizeof(float)},
        0,
        reinterpret_cast<const unsigned char*>(piece.rewards.data() +
                                               as_size(episode) * as_size(piece.action_rows))};
  for (std::size_t name = 0; name < format.observations(); ++name)
    add_observation(format, piece, episode, rows, name, slices);
  if (!piece.gradients.empty())
    for (std::size_t k = 0; k < format.gradients(); ++k)
      add_gradient(format, piece, episode, rows, k, slices);
  for (std::size_t k = 0; k < format.samples().size(); ++k)
    add_sample(format, piece, episode, rows, k, slices);
  return slices;
}

PreparedPiece prepare_piece(const DatasetLayout& layout, const DemoFormat& format,
                            const EpisodeRows& piece) {
  PreparedPiece prepared;
  prepared.sums.resize(as_size(piece.episodes));
  Cutter cutter(layout, format, prepared.chunks);
  for (int e = 0; e < piece.episodes; ++e) {
    const std::int64_t rows = rows_of_episode(layout, piece, e);
    const std::vector<PieceSlice> slices = slices_of(format, piece, e, rows);
    prepared.touching.push_back(touching_rows(format, slices));
    for (std::size_t dataset = 0; dataset < slices.size(); ++dataset) {
      const PlacedRows& r = slices[dataset].rows;
      if (r.rows == 0) continue;
      prepared.sums[as_size(e)].add(r.episode, r.name, r.first_row, r.rows, r.row_bytes,
                                    slices[dataset].data);
      const std::int64_t each = format.chunk_rows(dataset, rows);
      if (each == 0) continue;
      if (slices[dataset].first % each != 0)
        throw std::logic_error("a piece begins within a chunk");
      cutter.cut(e, dataset, slices[dataset], each);
    }
  }
  return prepared;
}

}  // namespace tangere
