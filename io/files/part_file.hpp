// SPDX-License-Identifier: Apache-2.0
// An output appears under its name whole or not at all: it is written beside it as <name>.part.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "io/files/written_bytes.hpp"

namespace tangere {

struct NamedBytes {
  std::span<const unsigned char> bytes;
  BytesOf what;
};

/// The file `<output>.part`, in the folder of the output, locked exclusively for the lifetime of
/// this object. A .part of a killed run is replaced; one that another process is writing is an
/// error.
class PartFile {
 public:
  /// Creates the .part, empty. Throws IoError, having created nothing, when the output exists and
  /// `overwrite` is false, is a folder or a device, when its folder is missing or not writable,
  /// when the .part is a file with a second name, or when another process is writing the same
  /// output. Throws InputError when the output or the .part is a kept input
  /// (io/files/input_files.hpp).
  PartFile(std::string output, bool overwrite);
  /// Removes the .part unless it was committed.
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  [[nodiscard]] const std::string& output() const { return output_; }
  [[nodiscard]] const std::string& path() const { return path_; }  ///< of the .part
  /// Space that this user can still fill on the disk of the output [bytes].
  [[nodiscard]] std::uint64_t free_bytes() const;

  /// Writes behind the last bytes.
  void write(std::string_view bytes);
  /// Writes the pieces one after the other at a place of the file.
  void write_at(std::uint64_t offset, std::span<const NamedBytes> pieces);
  /// Throws IoError if the file ends before, or does not have what was written.
  void read_at(std::uint64_t offset, std::span<unsigned char> bytes) const;
  [[nodiscard]] std::uint64_t size() const { return written_->size(); }
  /// Whoever writes into the file without this object adds there what it writes.
  [[nodiscard]] WrittenBytes* written() { return &*written_; }
  /// Reads the file back. Throws IoError with the first offset at which it differs from what was
  /// written.
  void compare() { written_->compare_all(); }
  /// Compares, forces the bytes to the disk and renames the .part to the output. Throws IoError;
  /// InputError when the output has become an input.
  void commit();

 private:
  std::string output_, path_;
  bool overwrite_;
  int descriptor_ = -1;
  std::optional<WrittenBytes> written_;
};

/// Removes the .part of every existing PartFile, of at most 64. Signal handlers may call it before
/// they end the process.
void remove_parts() noexcept;

/// Writes a whole text file, or leaves what was there.
void write_text_atomically(const std::string& path, std::string_view text, bool overwrite);

}  // namespace tangere
