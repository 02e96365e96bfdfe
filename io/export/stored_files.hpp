// SPDX-License-Identifier: Apache-2.0
// What an export says of its files: their sizes, and sums of their bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/export/json_file.hpp"

namespace tangere {

/// A file, or of Zarr the folder of an array with its chunks.
struct StoredFiles {
  std::string path;  ///< below the export
  std::uint64_t files = 0;
  std::uint64_t bytes = 0;  ///< of all of them
  /// Σ over files of CRC-32(name, a zero byte, the bytes), modulo 2³².
  std::uint64_t sum = 0;
  bool named = true;  ///< false: CRC-32 of the bytes alone, of a table
};

/// Those that the notes of an export list; none where an older version wrote it. Throws IoError for
/// lists that do not fit each other.
std::vector<StoredFiles> stored_files(const JsonFile& notes);

/// Throws IoError for the first path that is missing or does not have its files and bytes. Reads no
/// file whole.
void check_sizes(const std::filesystem::path& folder, const std::vector<StoredFiles>& stored);

/// Returns a message for each file in a folder of data, such as data/ or hdf5/, that is not listed:
/// readers of the format may take it for a part of the data set. Hidden files do not count.
std::vector<std::string> foreign_files(const std::filesystem::path& folder,
                                       const std::vector<StoredFiles>& stored);

/// Reads all files. Returns a message for each path whose size or sum is another.
std::vector<std::string> damaged_files(const std::filesystem::path& folder,
                                       const std::vector<StoredFiles>& stored);

}  // namespace tangere
