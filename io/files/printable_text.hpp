// SPDX-License-Identifier: Apache-2.0
// Names and texts of files, made fit for terminals and pictures: no character of theirs moves a
// cursor, reverses a line or makes a picture that XML readers refuse.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace tangere {

struct Utf8Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  ///< 0: what stands there is no UTF-8
};

/// Decodes the character that begins at byte `at`, which exists.
Utf8Character utf8_at(std::string_view text, std::size_t at);

/// Returns the text with `mark` and four hexadecimal digits in place of each control character but
/// line feed and tab, each character that sets the direction of writing or ends a line or
/// paragraph, U+FFFE and U+FFFF; and with \x and two digits in place of each byte that is no UTF-8.
std::string printable(std::string_view text, std::string_view mark = "\\u");

}  // namespace tangere
