// SPDX-License-Identifier: Apache-2.0
// libdeflate: twice zlib's speed and more, the same format.
#include "io/chunk_codec.hpp"

#include <libdeflate.h>

#include <algorithm>
#include <cstring>
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

/// Byte b of every number to its place from b * `stride` on. Shifted words, because compilers make vectors of those.
template <class Word>
void split(const unsigned char* data, std::size_t numbers, unsigned char* out, std::size_t stride) {
  constexpr std::size_t kTogether = 1024;  // stay in the first cache
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
  const std::size_t size = libdeflate_zlib_compress(compressor, plain.data(), plain.size(), room.data(), room.size());
  if (size == 0) throw std::logic_error("deflate needs more room than its own bound");
  return {room.begin(), room.begin() + static_cast<std::ptrdiff_t>(size)};
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

std::vector<h5::FileFilter> file_filters(const std::string& compression, std::size_t number_bytes) {
  constexpr std::uint16_t kDeflate = 1, kShuffle = 2;
  if (compression == "none") return {};
  return {{kShuffle, {}, {static_cast<std::uint32_t>(number_bytes)}}, {kDeflate, {}, {kDeflateLevel}}};
}

void shuffle(const unsigned char* data, std::size_t used, std::size_t width, std::vector<unsigned char>& out) {
  const std::size_t numbers = out.size() / width, given = used / width;
  if (width == sizeof(std::uint32_t))
    split<std::uint32_t>(data, given, out.data(), numbers);
  else if (width == sizeof(std::uint64_t))
    split<std::uint64_t>(data, given, out.data(), numbers);
  else
    throw std::logic_error("numbers that are neither of four nor of eight bytes");
  for (std::size_t b = 0; b < width; ++b)
    std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(b * numbers + given), numbers - given, static_cast<unsigned char>(0));
}

std::vector<unsigned char> compressed(const DatasetLayout& layout, const unsigned char* data, std::size_t used,
                                      std::size_t bytes) {
  thread_local std::vector<unsigned char> plain;
  plain.resize(bytes);
  shuffle(data, used, layout.single ? sizeof(float) : sizeof(double), plain);
  return deflated(plain);
}

}  // namespace tangere
