// SPDX-License-Identifier: Apache-2.0
// Which object of which file is being read, kept where another process can look it up after a
// crash of the library.
#pragma once

#include <span>
#include <string_view>

namespace tangere::h5 {

/// From now on what is read is noted in this memory, which has to stay. Empty: nowhere.
void note_reading_in(std::span<char> memory) noexcept;

/// Notes the file that was opened last, and the group, dataset or attribute that was asked for
/// last: "'<file>', object '<object>'", cut at the end of the memory, with a zero behind it.
void note_file(std::string_view path) noexcept;
void note_object(std::string_view name) noexcept;

}  // namespace tangere::h5
