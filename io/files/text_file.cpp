// SPDX-License-Identifier: Apache-2.0
// Uses system calls, because streams do not report the reason of a failed read.
#include "io/files/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "engine/base/error.hpp"
#include "io/files/input_files.hpp"
#include "io/files/printable_text.hpp"

namespace tangere {
namespace {

const char* kind_of(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a FIFO";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

/// Whether the file system is the kernel's own: its files count as regular, and may never end.
bool is_of_kernel(const std::string& path) {
  struct statfs system {};
  if (statfs(path.c_str(), &system) != 0) return false;
  return system.f_type == PROC_SUPER_MAGIC || system.f_type == SYSFS_MAGIC ||
         system.f_type == DEBUGFS_MAGIC || system.f_type == TRACEFS_MAGIC;
}

}  // namespace

void require_regular_file(const std::string& path, const char* expected) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0)
    throw IoError(fmt::format("{}: cannot be opened for reading: {}", path, std::strerror(errno)));
  if (!S_ISREG(info.st_mode))
    throw IoError(fmt::format("{}: is {}; expected {}", path, kind_of(info.st_mode), expected));
  if (is_of_kernel(path))
    throw IoError(fmt::format("{}: is a file of the kernel; expected {}", path, expected));
  constexpr std::string_view kPointer = "version https://git-lfs.github.com/spec/";
  std::array<char, kPointer.size()> head{};
  std::ifstream(path, std::ios::binary).read(head.data(), head.size());
  if (std::string_view(head.data(), head.size()) == kPointer)
    throw InputError(
        fmt::format("{}:1: a pointer of Git LFS to a file that was not fetched; expected {} "
                    "('git lfs pull' fetches it)",
                    path, expected));
  add_input(path, info);
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
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t bytes = utf8_at(text, i).bytes;
    if (bytes == 0) return i;
    i += bytes;
  }
  return std::string_view::npos;
}

}  // namespace tangere
