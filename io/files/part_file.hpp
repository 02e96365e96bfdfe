// SPDX-License-Identifier: Apache-2.0
// An output appears under its name whole or not at all: it is written beside it as <name>.part.
#pragma once

#include <sys/uio.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace tangere {

/// The file `<output>.part`, in the folder of the output, held exclusively while this lives.
/// A .part that a killed run left behind is taken over; one that another process is writing is not.
class PartFile {
 public:
  /// Creates the .part, empty. Throws IoError, having created nothing, when the output exists and
  /// `overwrite` is false, is a folder or a device, when its folder is missing or not writable, or
  /// when another process is writing the same output.
  PartFile(std::string output, bool overwrite);
  /// Removes the .part unless it was committed.
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  [[nodiscard]] const std::string& output() const { return output_; }
  [[nodiscard]] const std::string& path() const { return path_; }  ///< of the .part
  /// Space that this user can still fill on the disk of the output [bytes].
  [[nodiscard]] std::uint64_t free_bytes() const;

  void write(std::string_view bytes);
  /// Writes the pieces one after the other at a place of the file. Changes `pieces`.
  void write_at(std::uint64_t offset, std::span<iovec> pieces);
  /// Throws IoError if the file ends before.
  void read_at(std::uint64_t offset, std::span<unsigned char> bytes) const;
  [[nodiscard]] std::uint64_t size() const;
  /// Forces the bytes to the disk and renames the .part to the output. Throws IoError.
  void commit();

 private:
  std::string output_, path_;
  bool overwrite_;
  int descriptor_ = -1;
};

/// Writes a whole text file, or leaves what was there.
void write_text_atomically(const std::string& path, std::string_view text, bool overwrite);

}  // namespace tangere
