// SPDX-License-Identifier: Apache-2.0
// Uses the system's own calls, because a stream does not say why a read failed.
#include "io/files/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

const char* kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a FIFO";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

}  // namespace

void require_regular_file(const std::string& path, const char* expected) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0)
    throw IoError(fmt::format("{}: cannot be opened for reading: {}", path, std::strerror(errno)));
  if (!S_ISREG(info.st_mode))
    throw IoError(fmt::format("{}: is {}; expected {}", path, kind_of(info.st_mode), expected));
  constexpr std::string_view kPointer = "version https://git-lfs.github.com/spec/";
  std::array<char, kPointer.size()> head{};
  std::ifstream(path, std::ios::binary).read(head.data(), head.size());
  if (std::string_view(head.data(), head.size()) == kPointer)
    throw InputError(
        fmt::format("{}:1: a pointer of Git LFS to a file that was not fetched; expected {} "
                    "('git lfs pull' fetches it)",
                    path, expected));
}

std::string read_text_file(const std::string& path, std::size_t most, const char* expected) {
  require_regular_file(path, expected);
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0)
    throw IoError(fmt::format("{}: cannot be opened for reading: {}", path, std::strerror(errno)));
  std::string text;
  std::array<char, 1 << 16> piece{};
  int error = 0;
  while (text.size() <= most) {
    const ssize_t got = read(descriptor, piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) error = errno;
    if (got <= 0) break;
    text.append(piece.data(), static_cast<std::size_t>(got));
  }
  close(descriptor);
  if (error != 0) throw IoError(fmt::format("{}: reading failed: {}", path, std::strerror(error)));
  if (text.size() > most)
    throw InputError(
        fmt::format("{}: larger than {} MiB; expected {}", path, most >> 20, expected));
  return text;
}

std::size_t find_invalid_utf8(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  for (std::size_t i = 0; i < text.size();) {
    const unsigned char first = byte(i);
    std::size_t more = 0;
    std::uint32_t code = first;
    if (first >= 0xF0 && first < 0xF8)
      more = 3, code = first & 0x07U;
    else if (first >= 0xE0)
      more = 2, code = first & 0x0FU;
    else if (first >= 0xC0)
      more = 1, code = first & 0x1FU;
    if ((first >= 0x80 && more == 0) || first >= 0xF8 || i + more >= text.size()) return i;
    for (std::size_t k = 1; k <= more; ++k) {
      if ((byte(i + k) & 0xC0U) != 0x80) return i;
      code = code << 6 | (byte(i + k) & 0x3FU);
    }
    constexpr std::uint32_t kLeast[] = {0, 0x80, 0x800, 0x10000};
    if (code < kLeast[more] || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) return i;
    i += more + 1;
  }
  return std::string_view::npos;
}

}  // namespace tangere
