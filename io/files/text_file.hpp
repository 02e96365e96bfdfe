// SPDX-License-Identifier: Apache-2.0
// Input that is text: a scene, a table, a list. What is no regular file might never end.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tangere {

/// Throws IoError unless `path` leads to a regular file on a disk, which then counts as an input
/// (io/files/input_files.hpp); `expected` names what it should be. Throws InputError if the file is
/// a pointer of Git LFS, which stands in a checkout where large files were not fetched.
void require_regular_file(const std::string& path, const char* expected);

/// All bytes of a regular file. Throws like require_regular_file, and InputError when it has more
/// than `most` bytes.
std::string read_text_file(const std::string& path, std::size_t most, const char* expected);

/// Editors on Windows write it before UTF-8.
inline constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Where the first byte that is no UTF-8 stands; npos if there is none.
std::size_t find_invalid_utf8(std::string_view text);

}  // namespace tangere
