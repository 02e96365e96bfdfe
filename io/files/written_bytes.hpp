// SPDX-License-Identifier: Apache-2.0
// Checksums of the bytes written to a file. Every output is read back and compared with them before
// it is renamed, because a successful write does not guarantee stored data.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace tangere {

/// What some bytes of a file are, for messages: {"/q"}, or {"obs/pad of demo_", 7}.
struct BytesOf {
  std::string_view name;
  std::int64_t number = -1;  ///< appended to the name; negative: nothing is
};

/// Checksums of the bytes written to a file, range by range. Later writes replace earlier ones.
/// Ranges without a write are zeros. All functions throw IoError when the file cannot be read.
class WrittenBytes {
 public:
  /// For an empty file, which `descriptor` can read. It is not closed here. `path`: for messages.
  WrittenBytes(int descriptor, std::string path)
      : descriptor_(descriptor), path_(std::move(path)) {}

  /// Bytes that are about to be written at `offset`.
  void add(std::uint64_t offset, std::span<const unsigned char> bytes, const BytesOf& what);
  /// The file is about to be cut or extended to `size` bytes.
  void end_at(std::uint64_t size);
  /// Size that the file should have [bytes].
  [[nodiscard]] std::uint64_t size() const { return size_; }

  /// Whether it is of the file with this number on this device.
  [[nodiscard]] bool is_of(std::uint64_t device, std::uint64_t number) const;

  /// Compares the pieces that have any of these bytes with the file. Whoever reads what was written
  /// calls this first. Throws IoError that names the file, the bytes and what they are.
  void compare(std::uint64_t offset, std::uint64_t bytes) const;
  /// Compares the whole file, unless that was done since it changed. Throws IoError likewise.
  void compare_all();

 private:
  struct Piece {
    std::uint64_t end, sum;
    const std::string* name;
    std::int64_t number;
  };
  void clear_sums(std::uint64_t begin, std::uint64_t end);
  [[noreturn]] void throw_difference(std::uint64_t begin, std::uint64_t end,
                                     const std::string& name, std::int64_t number) const;

  int descriptor_;
  std::string path_;
  std::map<std::uint64_t, Piece> pieces_;  // by their first byte; none overlaps another
  std::set<std::string, std::less<>> names_;
  std::uint64_t size_ = 0;
  bool compared_ = false;
};

}  // namespace tangere
