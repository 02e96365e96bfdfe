// SPDX-License-Identifier: Apache-2.0
// The format of the HDF Group's LZ4 plug-in: u64 size of the data, u32 size of a block, then u32
// size and bytes of each block, all big-endian. A block as large as its decompressed data is not
// compressed.
#include "io/hdf5/h5_lz4.hpp"

#include <hdf5.h>
#include <lz4.h>

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "io/hdf5/h5_objects.hpp"

namespace tangere::h5 {
namespace {

constexpr std::uint64_t kMostBytes = std::uint64_t{1}
                                     << 32;  // of a chunk, even if a damaged file says more

std::uint64_t big_endian(const unsigned char* from, std::size_t bytes) {
  std::uint64_t value = 0;
  for (std::size_t k = 0; k < bytes; ++k) value = value << 8 | from[k];
  return value;
}

/// 0: unknown.
thread_local std::uint64_t expected_bytes = 0;

/// Decompresses `in` into `out`. Returns false if it is damaged.
bool decompress(const unsigned char* in, std::size_t size, unsigned char* out, std::uint64_t total,
                std::uint64_t block) {
  constexpr std::size_t kLength = 4;
  for (std::uint64_t done = 0; done < total;) {
    if (size < kLength) return false;
    const std::uint64_t requested = std::min(block, total - done), packed = big_endian(in, kLength);
    in += kLength;
    size -= kLength;
    if (packed > size || packed > INT32_MAX || requested > INT32_MAX) return false;
    if (packed == requested) {
      std::memcpy(out + done, in, requested);
    } else if (LZ4_decompress_safe(reinterpret_cast<const char*>(in),
                                   reinterpret_cast<char*>(out + done), static_cast<int>(packed),
                                   static_cast<int>(requested)) != static_cast<int>(requested)) {
      return false;
    }
    in += packed;
    size -= packed;
    done += requested;
  }
  return true;
}

/// The function that H5Z calls. Returns 0 on failure. It only decompresses, because our own threads
/// write chunks.
std::size_t filter(unsigned flags, std::size_t, const unsigned*, std::size_t size,
                   std::size_t* room, void** buffer) {
  constexpr std::size_t kHead = 12, kTotal = 8;
  if ((flags & H5Z_FLAG_REVERSE) == 0 || size < kHead) return 0;
  const auto* const in = static_cast<const unsigned char*>(*buffer);
  const std::uint64_t total = big_endian(in, kTotal),
                      block = big_endian(in + kTotal, kHead - kTotal);
  if (total == 0 || total > kMostBytes || block == 0) return 0;
  if (expected_bytes != 0 && total != expected_bytes) return 0;  // the library would read on
  void* const out = H5allocate_memory(total, false);
  if (out == nullptr) return 0;
  if (!decompress(in + kHead, size - kHead, static_cast<unsigned char*>(out), total, block)) {
    H5free_memory(out);
    return 0;
  }
  H5free_memory(*buffer);
  *buffer = out;
  *room = total;
  return total;
}

}  // namespace

ExpectedChunk::ExpectedChunk(std::uint64_t bytes) { expected_bytes = bytes; }
ExpectedChunk::~ExpectedChunk() { expected_bytes = 0; }

const void* lz4_filter() {
  static const H5Z_class2_t kind{H5Z_CLASS_T_VERS, kLz4Filter, 0,     1, "lz4",
                                 nullptr,          nullptr,    filter};
  return &kind;
}

void allow_lz4() {
  static const herr_t registered = H5Zregister(lz4_filter());
  static_cast<void>(registered);  // if refused, such chunks cannot be read, and the error says so
}

}  // namespace tangere::h5
