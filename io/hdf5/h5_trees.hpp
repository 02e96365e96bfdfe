// SPDX-License-Identifier: Apache-2.0
// Makes search trees of HDF5 files as bytes, built at once from sorted entries: the index of a
// dataset's chunks, and the members of a group of thousands.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "io/hdf5/h5_objects.hpp"

namespace tangere::h5 {

/// A chunk on disk, all filters applied.
struct FileChunk {
  std::array<std::uint64_t, 4>
      first{};  ///< its first number's place in the first dimensions; 0 in the others
  std::uint64_t address = 0;
  std::uint32_t bytes = 0;
};

/// Appends the index of a dataset's chunks, ascending, to bytes that begin at `base` in the file.
/// Returns its address, or kNowhere if there are no chunks. `rank`: rank of the dataset. Its chunks
/// have `chunk_rows` rows each.
std::uint64_t add_chunk_index(Bytes& out, std::uint64_t base, std::span<const FileChunk> chunks,
                              std::size_t rank, std::uint64_t chunk_rows);
/// Size of the index [bytes].
std::size_t chunk_index_bytes(std::size_t chunks, std::size_t rank);

/// A member of a group. Its name is the common prefix followed by its number.
struct FileMember {
  std::int64_t number = 0;    ///< from 0 on
  std::uint64_t address = 0;  ///< of the object
};

/// Receives the bytes that follow those of the call before.
using Spill = std::function<void(const Bytes&)>;

/// Appends a group of any number of members, in any order. Returns the address of the group. Its
/// count of links is 0 until it is linked; with `root` it is 1, for the group "/". With `spill`,
/// bytes are written as they are made, except the last ones, which include the group itself. The
/// bytes left in `out` follow the written ones.
std::uint64_t add_large_group(Bytes& out, std::uint64_t base, std::string_view prefix,
                              std::vector<FileMember> members, bool root = false,
                              const Spill& spill = {});

}  // namespace tangere::h5
