// SPDX-License-Identifier: Apache-2.0
// No allocation and nothing that takes long: objects of large files are noted one by one. The
// memory begins with the file, and the object follows.
#include "io/hdf5/reading_note.hpp"

#include <algorithm>

namespace tangere::h5 {
namespace {

std::span<char> note;
std::size_t file_end = 0;

std::size_t put(std::size_t at, std::string_view text) {
  const std::size_t bytes = std::min(text.size(), note.size() - 1 - at);
  std::copy_n(text.data(), bytes, note.data() + at);
  note[at + bytes] = '\0';
  return at + bytes;
}

}  // namespace

void note_reading_in(std::span<char> memory) noexcept { note = memory; }

void note_file(std::string_view path) noexcept {
  if (note.empty()) return;
  file_end = put(put(put(0, "'"), path), "'");
}

void note_object(std::string_view name) noexcept {
  if (note.empty()) return;
  put(put(put(file_end, ", object '"), name), "'");
}

}  // namespace tangere::h5
