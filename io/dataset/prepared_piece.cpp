// SPDX-License-Identifier: Apache-2.0
// ContentSum numbers the datasets: 0 for actions, then observations, then rewards of tasks, then
// derivatives, then samples.
#include "io/dataset/prepared_piece.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "engine/base/as_size.hpp"
#include "io/files/jpeg_file.hpp"

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

/// Layout of a dataset's rows: `readings` of height × width cells each. A cell is a point of a
/// field, or the whole row.
struct Cells {
  std::size_t readings = 1, height = 1, width = 1, bytes = 0;  ///< of a cell
  std::size_t tile_readings = 1, tile_height = 1, tile_width = 1;
  std::size_t rank = 0;  ///< of the tiles: 0 whole rows, 1 parts of a list, 2 of an image

  Cells(const std::vector<std::uint64_t>& shape, const ChunkPlan& plan, std::size_t row_bytes)
      : bytes(row_bytes) {
    if (!plan.may_be_absent) return;
    const std::size_t field = plan.window > 1 ? 1 : 0;  // where the shape of a field begins
    if (plan.window > 1) readings = shape[0], tile_readings = plan.tile[0];
    rank = shape.size() - field - 1;
    width = shape[field + rank - 1];
    tile_width = plan.tile[field + rank - 1];
    if (rank == 2) {
      height = shape[field];
      tile_height = plan.tile[field];
    }
    bytes = row_bytes / (readings * height * width);
  }
  [[nodiscard]] std::size_t line_bytes() const { return width * bytes; }
  [[nodiscard]] std::size_t row_bytes() const { return readings * height * line_bytes(); }
  [[nodiscard]] std::size_t tile_bytes() const {
    return tile_readings * tile_height * tile_width * bytes;
  }
  [[nodiscard]] std::array<std::uint64_t, 4> first(std::int64_t row, std::size_t reading,
                                                   std::size_t r, std::size_t c) const {
    std::array<std::uint64_t, 4> place{static_cast<std::uint64_t>(row)};
    std::size_t at = 0;
    if (readings > 1) place[++at] = reading;
    if (rank == 2) place[++at] = r;
    place[++at] = c;
    return place;
  }
};

/// What a piece has of a row of one dataset.
struct RowContent {
  RowSum sum;
  bool any = false;  ///< a number other than 0
};

/// Whether one of the numbers is not 0.
bool any_of_type(bool single, std::span<const unsigned char> bytes) {
  const auto numbers = [&]<class T>(T) {
    return std::span(reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T));
  };
  return single ? any_number(numbers(float{})) : any_number(numbers(double{}));
}

/// Cuts rows of datasets into chunks. Every number is read once; tiles of zeros are not read again.
class Cutter {
 public:
  Cutter(const DatasetLayout& layout, const DemoFormat& format, std::vector<PreparedChunk>& chunks)
      : layout_(layout), format_(format), chunks_(chunks) {}

  /// Whole rows, `each` of them in a chunk.
  void cut_rows(int episode, std::size_t dataset, const PieceSlice& slice, std::int64_t each) {
    const std::size_t bytes = slice.rows.row_bytes;
    for (std::int64_t row = 0; row < slice.rows.rows; row += each) {
      const std::size_t used = as_size(std::min(each, slice.rows.rows - row));
      chunks_.push_back(
          {episode,
           dataset,
           {static_cast<std::uint64_t>(slice.first + row)},
           compressed(layout_, format_.number_bytes(dataset), slice.data + as_size(row) * bytes,
                      used * bytes, as_size(each) * bytes)});
    }
  }

  /// Tiles of `each` rows that are not all zero. Returns the content of the rows.
  const std::vector<RowContent>& cut_tiles(int episode, std::size_t dataset,
                                           const PieceSlice& slice, std::int64_t each) {
    const Cells cells(format_.shape(dataset), format_.plan(dataset), slice.rows.row_bytes);
    content_.assign(as_size(slice.rows.rows), {});
    for (std::int64_t row = 0; row < slice.rows.rows; row += each) {
      const std::span<RowContent> content =
          std::span(content_)
              .subspan(as_size(row))
              .first(as_size(std::min(each, slice.rows.rows - row)));
      const unsigned char* const data = slice.data + as_size(row) * cells.row_bytes();
      for (std::size_t k = 0; k < cells.readings; k += cells.tile_readings) {
        mark_tiles(cells, data, content.size(), k);
        auto mark = marked_.begin();
        for (std::size_t r = 0; r < cells.height; r += cells.tile_height)
          for (std::size_t c = 0; c < cells.width; c += cells.tile_width)
            if (*mark++ != 0) {
              cut_tile(cells, data, k, r, c, content);
              chunks_.push_back({episode, dataset, cells.first(slice.first + row, k, r, c),
                                 compressed(layout_, format_.number_bytes(dataset), tile_.data(),
                                            tile_.size(), as_size(each) * cells.tile_bytes())});
            }
      }
    }
    return content_;
  }

 private:
  /// Marks the tiles of the readings from `first` on that are not zero in one of the rows.
  void mark_tiles(const Cells& cells, const unsigned char* data, std::size_t rows,
                  std::size_t first) {
    const std::size_t across = (cells.width + cells.tile_width - 1) / cells.tile_width,
                      down = (cells.height + cells.tile_height - 1) / cells.tile_height,
                      line = cells.line_bytes(), part = cells.tile_width * cells.bytes,
                      readings = std::min(cells.tile_readings, cells.readings - first),
                      lines = readings * cells.height;
    marked_.assign(across * down, 0);
    for (std::size_t k = 0; k < rows * lines; ++k) {
      const std::size_t line_in_row = first * cells.height + k % lines;
      const std::span<const unsigned char> whole(
          data + k / lines * cells.row_bytes() + line_in_row * line, line);
      char* const mark = marked_.data() + line_in_row % cells.height / cells.tile_height * across;
      if (!any_bit(whole)) continue;
      for (std::size_t tile = 0; tile < across; ++tile)
        if (mark[tile] == 0)
          mark[tile] =
              any_bit(whole.subspan(tile * part).first(std::min(part, line - tile * part))) ? 1 : 0;
    }
  }

  /// Cuts the tile that begins at reading `first`, row r, column c, from each row of the dataset.
  /// Cells outside are zero.
  void cut_tile(const Cells& cells, const unsigned char* data, std::size_t first, std::size_t r,
                std::size_t c, std::span<RowContent> content) {
    const std::size_t readings = std::min(cells.tile_readings, cells.readings - first),
                      high = std::min(cells.tile_height, cells.height - r),
                      wide = std::min(cells.tile_width, cells.width - c) * cells.bytes;
    tile_.assign(content.size() * cells.tile_bytes(), 0);
    unsigned char* out = tile_.data();
    for (std::size_t row = 0; row < content.size(); ++row, out += cells.tile_bytes()) {
      for (std::size_t k = 0; k < readings * high; ++k) {
        const std::size_t reading = k / high, line = k % high;
        const std::size_t at =
            (((first + reading) * cells.height + r + line) * cells.width + c) * cells.bytes;
        const std::span<const unsigned char> cut(data + row * cells.row_bytes() + at, wide);
        std::memcpy(out + (reading * cells.tile_height + line) * cells.tile_width * cells.bytes,
                    cut.data(), wide);
        content[row].sum.add(at, cut);
      }
      content[row].any =
          content[row].any || any_of_type(format_.single(), {out, cells.tile_bytes()});
    }
  }

  const DatasetLayout& layout_;
  const DemoFormat& format_;
  std::vector<PreparedChunk>& chunks_;
  std::vector<RowContent> content_;
  std::vector<char> marked_;
  std::vector<unsigned char> tile_;
};

/// Marks rows of an observation in which not all numbers are 0.
void mark_touching(const DemoFormat& format, const PieceSlice& slice, std::vector<char>& touching) {
  for (std::size_t row = 0; row < touching.size(); ++row)
    if (touching[row] == 0 &&
        any_of_type(format.single(),
                    slice.bytes().subspan(row * slice.rows.row_bytes, slice.rows.row_bytes)))
      touching[row] = 1;
}

/// Makes JPEG files of the rows of a slice, and adds their bytes to the sum.
PreparedPictures prepared_pictures(const DatasetLayout& layout, const DemoFormat& format,
                                   int episode, std::size_t dataset, const PieceSlice& slice,
                                   ContentSum& sum) {
  const std::vector<std::uint64_t>& shape = format.shape(dataset);
  const PlacedRows& r = slice.rows;
  PreparedPictures pictures{episode, dataset, slice.first, {}};
  for (std::int64_t row = 0; row < r.rows; ++row) {
    const std::string file = jpeg_bytes(
        static_cast<int>(shape[0]), static_cast<int>(shape[1]),
        slice.bytes().subspan(as_size(row) * r.row_bytes, r.row_bytes), layout.jpeg_quality);
    pictures.files.emplace_back(file.begin(), file.end());
    RowSum bytes;
    bytes.add(0, pictures.files.back());
    sum.add(r.episode, r.name, r.first_row + row, file.size(), bytes);
  }
  return pictures;
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
    std::vector<char> touching;
    for (std::size_t dataset = 0; dataset < slices.size(); ++dataset) {
      const PieceSlice& slice = slices[dataset];
      const PlacedRows& r = slice.rows;
      if (r.rows == 0) continue;
      if (format.as_jpeg(dataset)) {
        prepared.pictures.push_back(
            prepared_pictures(layout, format, e, dataset, slice, prepared.sums[as_size(e)]));
        continue;
      }
      const bool touch = format.is_touch(dataset);
      if (touch) touching.resize(as_size(r.rows), 0);
      const std::int64_t each = format.chunk_rows(dataset, rows);
      if (each > 0 && slice.first % each != 0)
        throw std::logic_error("a piece begins within a chunk");
      if (each > 0 && format.plan(dataset).may_be_absent) {
        const std::vector<RowContent>& content = cutter.cut_tiles(e, dataset, slice, each);
        for (std::size_t k = 0; k < content.size(); ++k) {
          prepared.sums[as_size(e)].add(r.episode, r.name, r.first_row + std::int64_t(k),
                                        r.row_bytes, content[k].sum);
          if (touch && content[k].any) touching[k] = 1;
        }
        continue;
      }
      prepared.sums[as_size(e)].add(r.episode, r.name, r.first_row, r.rows, r.row_bytes,
                                    slice.data);
      if (touch) mark_touching(format, slice, touching);
      if (each > 0) cutter.cut_rows(e, dataset, slice, each);
    }
    prepared.touching.push_back(std::count(touching.begin(), touching.end(), 1));
  }
  return prepared;
}

}  // namespace tangere
