// SPDX-License-Identifier: Apache-2.0
// libdeflate: twice zlib's speed and more, the same format.
#include "io/chunk_codec.hpp"

#include <libdeflate.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <new>
#include <numeric>
#include <stdexcept>

namespace tangere {
namespace {

constexpr double kChunkBytes = 64 << 10;      // a loader's random access reads a whole chunk
constexpr double kTogetherBytes = 512 << 10;  // rows of all observations in the span of a chunk: a piece holds at least as many
constexpr std::int64_t kMostRows = 64;
constexpr std::size_t kLeastRowBytes = 256;      // smaller rows: a chunk's index would cost more than compression gives
constexpr std::size_t kLeastLastBytes = 8 << 10;

std::size_t numbers_of(const std::vector<std::uint64_t>& shape) {
  return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
}

std::int64_t power_of_two_below(double most) {
  std::int64_t rows = 1;
  while (rows < kMostRows && static_cast<double>(2 * rows) <= most) rows *= 2;
  return rows;
}

struct Free {
  void operator()(libdeflate_compressor* compressor) const { libdeflate_free_compressor(compressor); }
};

libdeflate_compressor* compressor_of_thread() {
  thread_local const std::unique_ptr<libdeflate_compressor, Free> compressor(
      libdeflate_alloc_compressor(kDeflateLevel));
  if (!compressor) throw std::bad_alloc();
  return compressor.get();
}

/// HDF5's shuffle: byte 0 of all numbers, then byte 1 of all …; rows behind the last one are zeros.
template <std::size_t kWidth>
std::vector<unsigned char> shuffled(const unsigned char* data, std::size_t used, std::size_t bytes) {
  const std::size_t numbers = bytes / kWidth;
  std::vector<unsigned char> out(bytes, 0);
  for (std::size_t k = 0; k < used / kWidth; ++k)
    for (std::size_t b = 0; b < kWidth; ++b) out[b * numbers + k] = data[k * kWidth + b];
  return out;
}

/// `used` bytes of data in a chunk of `bytes`.
template <class T>
std::vector<unsigned char> deflated(const T* data, std::size_t used, std::size_t bytes) {
  const std::vector<unsigned char> plain =
      shuffled<sizeof(T)>(reinterpret_cast<const unsigned char*>(data), used, bytes);
  libdeflate_compressor* const compressor = compressor_of_thread();
  std::vector<unsigned char> out(libdeflate_zlib_compress_bound(compressor, bytes));
  const std::size_t size = libdeflate_zlib_compress(compressor, plain.data(), bytes, out.data(), out.size());
  if (size == 0) throw std::logic_error("deflate needs more room than its own bound");
  out.resize(size);
  out.shrink_to_fit();
  return out;
}

}  // namespace

std::vector<std::int64_t> chunk_rows(const DatasetLayout& layout) {
  const std::vector<std::vector<std::uint64_t>> shapes = layout.observation_shapes();
  std::vector<std::int64_t> rows(shapes.size(), 0);
  if (layout.compression == "none") return rows;
  const std::size_t width = layout.single ? sizeof(float) : sizeof(double);
  double together = 0;
  for (const auto& shape : shapes) together += static_cast<double>(numbers_of(shape) * width);
  for (std::size_t name = 0; name < shapes.size(); ++name) {
    const std::size_t bytes = numbers_of(shapes[name]) * width;
    if (bytes < kLeastRowBytes) continue;
    rows[name] = power_of_two_below(std::min(kChunkBytes / static_cast<double>(bytes), kTogetherBytes / together));
  }
  return rows;
}

bool compresses_last_row(std::size_t row_bytes) { return row_bytes >= kLeastLastBytes; }

std::vector<CompressedChunk> compress(const DatasetLayout& layout, const std::vector<std::int64_t>& rows_of_chunks,
                                      const EpisodeRows& piece) {
  std::vector<CompressedChunk> chunks;
  for (std::size_t name = 0; name < rows_of_chunks.size(); ++name) {
    if (rows_of_chunks[name] == 0) continue;
    if (piece.first_row % rows_of_chunks[name] != 0) throw std::logic_error("a piece begins within a chunk");
    std::visit(
        [&](const auto& values) {
          using T = typename std::decay_t<decltype(values)>::value_type;
          const std::size_t width = values.size() / static_cast<std::size_t>(piece.episodes) /
                                    static_cast<std::size_t>(piece.rows);
          for (int e = 0; e < piece.episodes; ++e) {
            const std::int64_t length = piece.ends.empty() ? layout.rows()
                                                           : std::max<std::int64_t>(1, piece.ends[static_cast<std::size_t>(e)].length);
            const std::int64_t each = std::min(rows_of_chunks[name], length);
            const std::int64_t end = std::min<std::int64_t>(piece.first_row + piece.rows, length);
            const auto row_at = [&](std::int64_t row) {
              return values.data() + (static_cast<std::size_t>(e) * static_cast<std::size_t>(piece.rows) +
                                      static_cast<std::size_t>(row - piece.first_row)) * width;
            };
            const std::size_t row_bytes = width * sizeof(T);
            for (std::int64_t row = piece.first_row; row < end; row += each)
              chunks.push_back({e, name, row, false,
                                deflated(row_at(row), static_cast<std::size_t>(std::min(each, end - row)) * row_bytes,
                                         static_cast<std::size_t>(each) * row_bytes)});
            const bool has_last = length >= piece.first_row && length < piece.first_row + piece.rows;
            if (has_last && compresses_last_row(row_bytes))
              chunks.push_back({e, name, 0, true, deflated(row_at(length), row_bytes, row_bytes)});
          }
        },
        piece.observations[name]);
  }
  return chunks;
}

}  // namespace tangere
