// SPDX-License-Identifier: Apache-2.0
// Decodes UTF-8 strictly: no overlong forms, no surrogates, nothing beyond U+10FFFF.
#include "io/files/printable_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace tangere {
namespace {

bool is_printable(std::uint32_t c) {
  if (c < 0x20) return c == '\n' || c == '\t';
  const bool control = c >= 0x7F && c < 0xA0, line_end = c == 0x2028 || c == 0x2029,
             direction = c == 0x061C || c == 0x200E || c == 0x200F ||
                         (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
  return !control && !line_end && !direction && c != 0xFFFE && c != 0xFFFF;
}

}  // namespace

Utf8Character utf8_at(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(at);
  std::size_t more = 0;
  std::uint32_t code = first;
  if (first >= 0xF0 && first < 0xF8)
    more = 3, code = first & 0x07U;
  else if (first >= 0xE0)
    more = 2, code = first & 0x0FU;
  else if (first >= 0xC0)
    more = 1, code = first & 0x1FU;
  if ((first >= 0x80 && more == 0) || first >= 0xF8 || at + more >= text.size()) return {};
  for (std::size_t k = 1; k <= more; ++k) {
    if ((byte(at + k) & 0xC0U) != 0x80) return {};
    code = code << 6 | (byte(at + k) & 0x3FU);
  }
  constexpr std::uint32_t kLeast[] = {0, 0x80, 0x800, 0x10000};
  if (code < kLeast[more] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) return {};
  return {code, more + 1};
}

std::string printable(std::string_view text, std::string_view mark) {
  std::string out;
  out.reserve(text.size());
  std::size_t kept = 0;  // bytes that are in `out`, or replaced there
  for (std::size_t i = 0; i < text.size();) {
    const Utf8Character c = utf8_at(text, i);
    const std::size_t next = i + std::max<std::size_t>(c.bytes, 1);
    if (c.bytes == 0 || !is_printable(c.code)) {
      out += text.substr(kept, i - kept);
      if (c.bytes == 0)
        fmt::format_to(std::back_inserter(out), "\\x{:02x}", static_cast<unsigned char>(text[i]));
      else
        fmt::format_to(std::back_inserter(out), "{}{:04x}", mark, c.code);
      kept = next;
    }
    i = next;
  }
  return out += text.substr(kept);
}

}  // namespace tangere
