// SPDX-License-Identifier: Apache-2.0
// Uses libdeflate, which writes zlib's format at least twice as fast as zlib.
#include "io/dataset/chunk_codec.hpp"

#include <libdeflate.h>
#include <lz4.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <numeric>
#include <stdexcept>

namespace tangere {
namespace {

constexpr double kChunkBytes = 64 << 10;  // a loader's random access reads a whole chunk
constexpr double kTileBytes =
    24 << 10;  // a tile that is touched in one row is stored for all rows of its chunk
constexpr double kTogetherBytes =
    512 << 10;  // all observations over the rows of a chunk; a piece holds at least as many rows
constexpr std::int64_t kMostRows = 64;
constexpr std::size_t kLeastRowBytes =
    256;  // for smaller rows a chunk's index would cost more than compression gains
constexpr std::size_t kLeastLastBytes = 8 << 10, kLeastTiledBytes = 8 << 10;
// Most points along a side of a field's tile, twice as many for large fields; most points in a tile
// of a curved pad. Tiles that nothing touches are left out.
constexpr std::uint64_t kTileSide = 16, kLargeSide = 128, kTilePoints = 256;

/// Bytes of a number of an observation.
std::size_t number_bytes(const DatasetLayout& layout, std::size_t own) {
  return own > 0 ? own : layout.single ? sizeof(float) : sizeof(double);
}

std::size_t numbers_of(const std::vector<std::uint64_t>& shape) {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
}

/// Points of a tile along a side of `points`: as few tiles as have at most `most` each, of equal
/// size, so that little of the last one lies outside.
std::uint64_t tile_side(std::uint64_t points, std::uint64_t most) {
  const std::uint64_t tiles = std::max<std::uint64_t>(1, (points + most - 1) / most);
  return (points + tiles - 1) / tiles;
}

std::int64_t power_of_two_below(double most) {
  std::int64_t rows = 1;
  while (rows < kMostRows && static_cast<double>(2 * rows) <= most) rows *= 2;
  return rows;
}

struct Free {
  void operator()(libdeflate_compressor* compressor) const {
    libdeflate_free_compressor(compressor);
  }
};

libdeflate_compressor* compressor_of_thread() {
  thread_local const std::unique_ptr<libdeflate_compressor, Free> compressor(
      libdeflate_alloc_compressor(kDeflateLevel));
  if (!compressor) throw std::bad_alloc();
  return compressor.get();
}

/// Moves byte b of every number to its place from b * `stride` on. It shifts words, because
/// compilers vectorise that.
template <class Word>
void split(const unsigned char* data, std::size_t numbers, unsigned char* out, std::size_t stride) {
  constexpr std::size_t kTogether = 1024;  // numbers that fit the first cache
  for (std::size_t first = 0; first < numbers; first += kTogether) {
    const std::size_t count = std::min(kTogether, numbers - first);
    for (std::size_t b = 0; b < sizeof(Word); ++b) {
      unsigned char* const plane = out + b * stride + first;
      const unsigned char* const from = data + first * sizeof(Word);
      for (std::size_t k = 0; k < count; ++k) {
        Word word;
        std::memcpy(&word, from + k * sizeof word, sizeof word);
        plane[k] = static_cast<unsigned char>(word >> (8 * b));
      }
    }
  }
}

std::vector<unsigned char> deflated(const std::vector<unsigned char>& plain) {
  libdeflate_compressor* const compressor = compressor_of_thread();
  thread_local std::vector<unsigned char> room;
  room.resize(std::max(room.size(), libdeflate_zlib_compress_bound(compressor, plain.size())));
  const std::size_t size =
      libdeflate_zlib_compress(compressor, plain.data(), plain.size(), room.data(), room.size());
  if (size == 0) throw std::logic_error("deflate needs more room than its own bound");
  return {room.begin(), room.begin() + static_cast<std::ptrdiff_t>(size)};
}

void add_big_endian(std::vector<unsigned char>& out, std::uint64_t value, std::size_t bytes) {
  for (std::size_t k = bytes; k-- > 0;) out.push_back(static_cast<unsigned char>(value >> (8 * k)));
}

/// Writes one block in the format of the HDF Group's plug-in: size of the data and of a block, then
/// each block's size and bytes, big-endian.
std::vector<unsigned char> lz4(const std::vector<unsigned char>& plain) {
  const auto bytes = static_cast<int>(plain.size());
  thread_local std::vector<char> room;
  room.resize(std::max(room.size(), static_cast<std::size_t>(LZ4_compressBound(bytes))));
  const int size = LZ4_compress_default(reinterpret_cast<const char*>(plain.data()), room.data(),
                                        bytes, static_cast<int>(room.size()));
  if (size <= 0) throw std::logic_error("LZ4 needs more room than its own bound");
  const bool smaller = size < bytes;  // a block that keeps its size is not compressed
  std::vector<unsigned char> out;
  add_big_endian(out, plain.size(), 8);
  add_big_endian(out, plain.size(), 4);
  add_big_endian(out, static_cast<std::uint64_t>(smaller ? size : bytes), 4);
  if (smaller)
    out.insert(out.end(), room.begin(), room.begin() + size);
  else
    out.insert(out.end(), plain.begin(), plain.end());
  return out;
}

/// Cuts a field into tiles. The last dimension, a point's numbers, stays whole.
std::vector<std::uint64_t> field_tile(const std::vector<std::uint64_t>& field) {
  std::vector<std::uint64_t> tile = field;
  const std::size_t tiled = field.size() - 1;
  const std::uint64_t side = tiled == 1 ? kTilePoints
                             : *std::max_element(field.begin(), field.end()) < kLargeSide
                                 ? kTileSide
                                 : 2 * kTileSide;
  for (std::size_t k = 0; k < tiled; ++k) tile[k] = tile_side(field[k], side);
  return tile;
}

/// Pictures in colours and numbers of bodies are nowhere zero, so they have no tiles. `window`:
/// readings of a row, which are as large as one another.
ChunkPlan chunk_plan(const DatasetLayout& layout, const std::vector<std::uint64_t>& shape,
                     std::size_t own, double together, int window = 1) {
  const std::size_t row_bytes = numbers_of(shape) * number_bytes(layout, own);
  if (layout.as_jpeg(shape, own)) return {0, shape};
  const std::vector<std::uint64_t> field(shape.begin() + (window > 1 ? 1 : 0), shape.end());
  const bool sparse = layout.sparse && own == 0 && (field.size() == 2 || field.size() == 3) &&
                      row_bytes / static_cast<std::size_t>(window) >= kLeastTiledBytes;
  ChunkPlan plan;
  plan.tile = shape;
  plan.window = static_cast<std::uint64_t>(window);
  if (sparse) {
    plan.may_be_absent = true;
    plan.tile = field_tile(field);
    if (window > 1) {
      const double bytes = static_cast<double>(numbers_of(plan.tile) * number_bytes(layout, own));
      const std::uint64_t most =
          static_cast<std::uint64_t>(std::max(1.0, std::floor(kTileBytes / bytes)));
      plan.tile.insert(plan.tile.begin(), tile_side(plan.window, most));
    }
  } else if (layout.compression == "none" || row_bytes < kLeastRowBytes) {
    return plan;
  }
  const double tile_bytes = static_cast<double>(numbers_of(plan.tile)) /
                            static_cast<double>(numbers_of(shape)) * static_cast<double>(row_bytes);
  plan.rows = power_of_two_below(std::min((sparse ? kTileBytes : kChunkBytes) / tile_bytes,
                                          (sparse ? 2 : 1) * kTogetherBytes / together));
  plan.last_row = sparse || row_bytes >= kLeastLastBytes;
  return plan;
}

}  // namespace

std::vector<ChunkPlan> chunk_plans(const DatasetLayout& layout) {
  const std::vector<std::vector<std::uint64_t>> shapes = layout.observation_shapes();
  const std::vector<std::size_t> own_bytes = layout.observation_bytes();
  const std::vector<int> windows = layout.observation_windows();
  double together = 0;
  for (std::size_t k = 0; k < shapes.size(); ++k)
    together += static_cast<double>(numbers_of(shapes[k]) * number_bytes(layout, own_bytes[k]));
  const std::vector<DatasetSample> samples = layout.samples();
  std::vector<ChunkPlan> plans;
  plans.reserve(shapes.size() + samples.size());
  for (std::size_t k = 0; k < shapes.size(); ++k)
    plans.push_back(chunk_plan(layout, shapes[k], own_bytes[k], together, windows[k]));
  for (const DatasetSample& sample : samples)
    plans.push_back(chunk_plan(layout, sample.shape, sample.own_bytes, 1));
  return plans;
}

bool has_chunks(const DatasetLayout& layout) {
  const std::vector<ChunkPlan> plans = chunk_plans(layout);
  return std::any_of(plans.begin(), plans.end(),
                     [](const ChunkPlan& plan) { return plan.rows > 0; });
}

bool has_tiles(const DatasetLayout& layout) {
  const std::vector<ChunkPlan> plans = chunk_plans(layout);
  return std::any_of(plans.begin(), plans.end(),
                     [](const ChunkPlan& plan) { return plan.may_be_absent; });
}

std::vector<h5::FileFilter> file_filters(const std::string& compression, std::size_t number_bytes) {
  constexpr std::uint16_t kDeflate = 1, kShuffle = 2;
  if (compression == "none") return {};
  std::vector<h5::FileFilter> filters;
  if (number_bytes > 1)
    filters.push_back({kShuffle, {}, {static_cast<std::uint32_t>(number_bytes)}});
  if (compression == "lz4")
    filters.push_back({h5::kLz4Filter, "lz4", {0}});
  else
    filters.push_back({kDeflate, {}, {kDeflateLevel}});
  return filters;
}

void shuffle(const unsigned char* data, std::size_t used, std::size_t width,
             std::vector<unsigned char>& out) {
  const std::size_t numbers = out.size() / width, given = used / width;
  if (width == sizeof(std::uint16_t))
    split<std::uint16_t>(data, given, out.data(), numbers);
  else if (width == sizeof(std::uint32_t))
    split<std::uint32_t>(data, given, out.data(), numbers);
  else if (width == sizeof(std::uint64_t))
    split<std::uint64_t>(data, given, out.data(), numbers);
  else if (width == 1)
    std::copy_n(data, given, out.begin());
  else
    throw std::logic_error("numbers that are neither of one, two, four nor eight bytes");
  for (std::size_t b = 0; b < width; ++b)
    std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(b * numbers + given), numbers - given,
                static_cast<unsigned char>(0));
}

std::vector<unsigned char> compressed(const DatasetLayout& layout, std::size_t width,
                                      const unsigned char* data, std::size_t used,
                                      std::size_t bytes) {
  if (layout.compression == "none") {
    std::vector<unsigned char> same(data, data + used);
    same.resize(bytes, 0);
    return same;
  }
  thread_local std::vector<unsigned char> plain;
  plain.resize(bytes);
  shuffle(data, used, width, plain);
  return layout.compression == "lz4" ? lz4(plain) : deflated(plain);
}

}  // namespace tangere
