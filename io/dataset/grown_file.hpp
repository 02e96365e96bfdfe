// SPDX-License-Identifier: Apache-2.0
// A file that the HDF5 library begins and ends. The thousands of members between are laid out here.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "io/dataset/placed_file.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_trees.hpp"

namespace tangere {

/// Call in this order: file() → close() → append() … → open() → file() → commit(). Everything
/// throws IoError.
class GrownFile {
 public:
  /// Begins `<path>.part`; `views` as for h5::create_file.
  GrownFile(const std::string& path, bool overwrite, bool views);
  /// Leaves nothing behind unless it was committed.
  GrownFile(const GrownFile&) = delete;
  GrownFile& operator=(const GrownFile&) = delete;

  [[nodiscard]] const h5::Id& file() const { return file_; }
  [[nodiscard]] const std::string& output() const { return part_.output(); }

  void close();
  /// Address of the next bytes.
  [[nodiscard]] std::uint64_t here() const { return here_; }
  void append(const h5::Bytes& bytes, const BytesOf& what);
  /// Appends a group to which the library may add members. The arguments are those of
  /// h5::add_large_group. Returns its address.
  std::uint64_t append_group(std::string_view prefix, std::vector<h5::FileMember> members,
                             bool root = false);
  /// `root`: address of the group "/"; h5::kNowhere leaves the group where it was.
  void open(std::uint64_t root = h5::kNowhere);

  /// Reads the file back and compares it with what was written, calls `last` with the path of
  /// the .part, syncs and renames.
  /// Returns the size in bytes.
  std::uint64_t commit(const std::function<void(const std::string&)>& last = {});

 private:
  PartFile part_;
  PlacedFile placed_;
  h5::Id file_;
  std::uint64_t here_ = 0;
};

}  // namespace tangere
