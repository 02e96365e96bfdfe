// SPDX-License-Identifier: Apache-2.0
// Sizes cost one call of the system for each file. A chunk of Zarr that is cut short is named,
// because Blosc begins it with its length: bytes 12 to 15, little-endian.
#include "io/export/stored_files.hpp"

#include <fmt/format.h>
#include <libdeflate.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <set>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBlock = std::size_t{1} << 20;
constexpr std::size_t kBloscHead = 16, kBloscBytes = 12;

/// The files of a path: itself, or those of a folder that do not begin with a dot.
std::vector<fs::path> files_of(const fs::path& place) {
  std::error_code none;
  if (!fs::is_directory(place, none)) return {place};
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(place))
    if (entry.is_regular_file() && entry.path().filename().string().front() != '.')
      files.push_back(entry.path());
  return files;
}

/// Files and bytes of a path, without its sum.
StoredFiles sizes_of(const fs::path& folder, const std::string& path) {
  StoredFiles found{path, 0, 0, 0};
  for (const fs::path& file : files_of(folder / path)) {
    std::error_code missing;
    const std::uintmax_t bytes = fs::file_size(file, missing);
    if (!missing) ++found.files, found.bytes += bytes;
  }
  return found;
}

std::uint64_t sum_of(const fs::path& path, bool named) {
  std::ifstream file(path, std::ios::binary);
  const std::string name = path.filename().string();
  std::uint32_t sum = named ? libdeflate_crc32(0, name.c_str(), name.size() + 1) : 0;
  std::vector<char> block(kBlock);
  while (file) {
    file.read(block.data(), std::ssize(block));
    sum = libdeflate_crc32(sum, block.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (!file.eof()) throw IoError(fmt::format("'{}' cannot be read", path.string()));
  return sum;
}

/// A chunk whose length is not the one that Blosc says; empty where there is none.
std::string cut_chunk(const fs::path& place) {
  for (const fs::path& path : files_of(place)) {
    std::ifstream file(path, std::ios::binary);
    char head[kBloscHead] = {};
    file.read(head, sizeof head);
    std::uint32_t bytes = 0;
    std::memcpy(&bytes, head + kBloscBytes, sizeof bytes);
    if (const std::uintmax_t found = fs::file_size(path); found != bytes || !file)
      return fmt::format("'{}' is damaged: it has {} bytes; expected {}", path.string(), found,
                         bytes);
  }
  return "";
}

/// What is wrong with the sizes of a path; empty where nothing is.
std::string size_fault(const fs::path& folder, const StoredFiles& expected) {
  const fs::path place = folder / expected.path;
  const StoredFiles found = sizes_of(folder, expected.path);
  if (found.files == expected.files && found.bytes == expected.bytes) return "";
  std::error_code none;
  if (!fs::is_directory(place, none))
    return found.files == 0
               ? fmt::format("'{}' is missing; expected {} bytes", place.string(), expected.bytes)
               : fmt::format("'{}' is damaged: it has {} bytes; expected {}", place.string(),
                             found.bytes, expected.bytes);
  if (found.files == expected.files)
    if (std::string chunk = cut_chunk(place); !chunk.empty()) return chunk;
  return fmt::format("'{}' is damaged: it has {} files of {} bytes together; expected {} of {}",
                     place.string(), found.files, found.bytes, expected.files, expected.bytes);
}

}  // namespace

std::vector<StoredFiles> stored_files(const JsonFile& notes) {
  if (!notes.has({"stored"})) return {};
  const std::vector<std::string> paths = notes.texts({"stored", "paths"});
  const std::vector<std::uint64_t> files = notes.counts({"stored", "files"}),
                                   bytes = notes.counts({"stored", "bytes"}),
                                   sums = notes.counts({"stored", "sums"});
  if (files.size() != paths.size() || bytes.size() != paths.size() || sums.size() != paths.size())
    throw IoError(
        fmt::format("'{}' is damaged: the lists of 'stored' differ in length", notes.path()));
  std::vector<StoredFiles> stored;
  for (std::size_t i = 0; i < paths.size(); ++i)
    stored.push_back({paths[i], files[i], bytes[i], sums[i]});
  return stored;
}

void check_sizes(const fs::path& folder, const std::vector<StoredFiles>& stored) {
  for (const StoredFiles& expected : stored)
    if (const std::string fault = size_fault(folder, expected); !fault.empty())
      throw IoError(fault);
}

std::vector<std::string> foreign_files(const fs::path& folder,
                                       const std::vector<StoredFiles>& stored) {
  std::set<std::string> known{"meta/info.json", "meta/tangere.json"};  // people may edit these
  for (const StoredFiles& one : stored) known.insert(one.path);
  std::vector<std::string> faults;
  std::error_code none;
  for (const char* const place : {"data", "meta", "videos", "hdf5"})
    for (const fs::directory_entry& entry :
         fs::recursive_directory_iterator(folder / place, none)) {
      const fs::path path = entry.path().lexically_relative(folder);
      if (!entry.is_regular_file(none) || path.filename().string().front() == '.' ||
          known.contains(path.string()) || known.contains(path.parent_path().string()))
        continue;
      faults.push_back(
          fmt::format("'{}' is not a file of this export; expected none, because a reader may take "
                      "it for a part of the data set",
                      entry.path().string()));
    }
  std::sort(faults.begin(), faults.end());
  return faults;
}

std::vector<std::string> damaged_files(const fs::path& folder,
                                       const std::vector<StoredFiles>& stored) {
  std::vector<std::string> faults;
  for (const StoredFiles& expected : stored) {
    if (std::string fault = size_fault(folder, expected); !fault.empty()) {
      faults.push_back(std::move(fault));
      continue;
    }
    std::uint64_t sum = 0;
    for (const fs::path& file : files_of(folder / expected.path))
      sum += sum_of(file, expected.named);
    sum &= 0xFFFFFFFF;
    if (sum != expected.sum)
      faults.push_back(
          fmt::format("'{}' is damaged: the checksum of its bytes is {:08x}; expected "
                      "{:08x}",
                      (folder / expected.path).string(), sum, expected.sum));
  }
  return faults;
}

}  // namespace tangere
