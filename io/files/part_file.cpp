// SPDX-License-Identifier: Apache-2.0
// Locking, renaming and flushing, in the order that leaves no half file under the final name.
#include "io/files/part_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <stdio.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <utility>
#include <vector>

#include "engine/base/error.hpp"
#include "io/files/input_files.hpp"

namespace tangere {
namespace {

[[noreturn]] void fail(std::string_view operation, const std::string& path, int error) {
  throw IoError(fmt::format("cannot {} '{}': {}", operation, path, std::strerror(error)));
}

std::string folder_of(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

void check_folder(const std::string& output) {
  const std::string folder = folder_of(output);
  struct stat info {};
  if (stat(folder.c_str(), &info) != 0) {
    if (errno == ENOENT)
      throw IoError(fmt::format(
          "cannot write '{}': the folder '{}' does not exist; create it first", output, folder));
    fail("read the folder", folder, errno);
  }
  if (!S_ISDIR(info.st_mode))
    throw IoError(fmt::format("cannot write '{}': '{}' is not a folder", output, folder));
}

/// Does not follow links, because a rename replaces the link itself.
void check_output(const std::string& output, bool overwrite) {
  struct stat info {};
  if (lstat(output.c_str(), &info) != 0) {
    if (errno == ENOENT) return;
    fail("write", output, errno);
  }
  if (S_ISDIR(info.st_mode))
    throw IoError(fmt::format("cannot write '{}': it is a folder; expected a file name", output));
  if (!S_ISREG(info.st_mode) && !S_ISLNK(info.st_mode))
    throw IoError(fmt::format("cannot write '{}': it is not a regular file", output));
  if (!overwrite)
    throw IoError(fmt::format("'{}' exists already; give --overwrite to replace it", output));
}

/// Whether the open file is still the one at `path`. Its owner may have renamed it meanwhile.
bool is_at(int descriptor, const std::string& path) {
  struct stat ours {
  }, there{};
  return fstat(descriptor, &ours) == 0 && lstat(path.c_str(), &there) == 0 &&
         ours.st_dev == there.st_dev && ours.st_ino == there.st_ino;
}

/// A lock of the open file, not of the process: other threads are kept out as well, a killed
/// process loses it, and HDF5's own locks do not meet it. Returns 0 or the error.
int lock(int descriptor) {
  struct flock whole {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  return fcntl(descriptor, F_OFD_SETLK, &whole) == 0 ? 0 : errno;
}

void sync_folder(const std::string& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;  // writable but not readable: nothing to sync through
  const int error = fsync(descriptor) == 0 ? 0 : errno;
  close(descriptor);
  // EINVAL: this kind of file system cannot sync folders.
  if (error != 0 && error != EINVAL) fail("flush the folder", folder, error);
}

// Paths of the .parts that this process holds, for a handler of signals.
std::array<std::atomic<const char*>, 64> parts_held{};
static_assert(std::atomic<const char*>::is_always_lock_free, "the handler may not wait");

/// RAII: blocks signals in this thread, so that a .part is in the list exactly while the file
/// exists.
class NoSignals {
 public:
  NoSignals() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, &before_);
  }
  ~NoSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  NoSignals(const NoSignals&) = delete;
  NoSignals& operator=(const NoSignals&) = delete;

 private:
  sigset_t before_{};
};

void hold_part(const std::string& path) {
  for (std::atomic<const char*>& place : parts_held)
    if (const char* none = nullptr; place.compare_exchange_strong(none, path.c_str())) return;
}

void let_part_go(const std::string& path) noexcept {
  for (std::atomic<const char*>& place : parts_held)
    if (const char* it = path.c_str(); place.compare_exchange_strong(it, nullptr)) return;
}

/// 0 or the error; EEXIST when `to` exists and must not be replaced.
int rename_to(const std::string& from, const std::string& to, bool overwrite) {
  if (!overwrite) {
    if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS) return errno;
    struct stat info {};  // the file system has no such rename: test first
    if (lstat(to.c_str(), &info) == 0) return EEXIST;
  }
  return rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace

PartFile::PartFile(std::string output, bool overwrite)
    : output_(std::move(output)), path_(output_ + ".part"), overwrite_(overwrite) {
  if (output_.empty()) throw IoError("the output has an empty file name");
  if (output_.find('\0') != std::string::npos)
    throw IoError("the name of the output contains a NUL character");
  check_folder(output_);
  refuse_input(output_);
  refuse_input(path_);
  check_output(output_, overwrite_);
  const NoSignals until_it_is_held;
  for (int attempt = 0;; ++attempt) {
    const int flags = O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_CREAT;
    bool is_new = true;
    int descriptor = open(path_.c_str(), flags | O_EXCL, 0666);
    if (descriptor < 0 && errno == EEXIST) {
      is_new = false;
      descriptor = open(path_.c_str(), flags, 0666);
    }
    if (descriptor < 0 && errno != ELOOP) fail("create", path_, errno);
    struct stat info {};
    if (descriptor < 0 || fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode)) {
      close(descriptor);
      throw IoError(fmt::format("cannot create '{}': it exists and is not a regular file", path_));
    }
    if (info.st_nlink > 1) {
      close(descriptor);
      throw IoError(fmt::format(
          "cannot create '{}': it exists and is a file with {} names; remove this name of it",
          path_, info.st_nlink));
    }
    const int error = lock(descriptor);
    if (error == EAGAIN || error == EACCES) {
      close(descriptor);
      throw IoError(
          fmt::format("cannot write '{}': another process is writing '{}'", output_, path_));
    }
    if (error != 0 && !is_new) {  // a file system without locks: the owner is unknown
      close(descriptor);
      throw IoError(fmt::format("cannot write '{}': '{}' exists; remove it if no run is writing it",
                                output_, path_));
    }
    if (is_at(descriptor, path_)) {
      descriptor_ = descriptor;
      hold_part(path_);
      break;
    }
    close(descriptor);
    if (attempt == 9)
      throw IoError(fmt::format("cannot create '{}': other processes keep replacing it", path_));
  }
  if (ftruncate(descriptor_, 0) != 0) {
    const int error = errno;
    let_part_go(path_);
    unlink(path_.c_str());
    close(descriptor_);
    fail("create", path_, error);
  }
  written_.emplace(descriptor_, path_);
}

PartFile::~PartFile() {
  if (descriptor_ < 0) return;
  const NoSignals until_it_is_gone;
  let_part_go(path_);
  unlink(path_.c_str());  // before the lock goes
  close(descriptor_);
}

void remove_parts() noexcept {
  for (const std::atomic<const char*>& place : parts_held)
    if (const char* const path = place; path != nullptr) unlink(path);
}

std::uint64_t PartFile::free_bytes() const {
  struct statvfs info {};
  if (fstatvfs(descriptor_, &info) != 0) fail("ask for the free space of", path_, errno);
  return std::uint64_t{info.f_bavail} * std::uint64_t{info.f_frsize};
}

void PartFile::write(std::string_view bytes) {
  const NamedBytes text{{reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()},
                        {"text"}};
  write_at(size(), {&text, 1});
}

void PartFile::write_at(std::uint64_t offset, std::span<const NamedBytes> pieces) {
  constexpr std::size_t kMostPieces = 1024;  // IOV_MAX of Linux
  std::vector<iovec> left;
  left.reserve(pieces.size());
  for (std::uint64_t at = offset; const NamedBytes& piece : pieces) {
    written_->add(at, piece.bytes, piece.what);
    at += piece.bytes.size();
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): iovec is also for reads
    left.push_back({const_cast<unsigned char*>(piece.bytes.data()), piece.bytes.size()});
  }
  for (std::span<iovec> next = left; !next.empty();) {
    const auto count = static_cast<int>(std::min(next.size(), kMostPieces));
    const ssize_t result = pwritev(descriptor_, next.data(), count, static_cast<off_t>(offset));
    if (result < 0) {
      if (errno == EINTR) continue;
      fail("write", path_, errno);
    }
    auto written = static_cast<std::size_t>(result);
    offset += written;
    while (!next.empty() && written >= next.front().iov_len) {
      written -= next.front().iov_len;
      next = next.subspan(1);
    }
    if (written == 0) continue;
    next.front().iov_base = static_cast<unsigned char*>(next.front().iov_base) + written;
    next.front().iov_len -= written;
  }
}

void PartFile::read_at(std::uint64_t offset, std::span<unsigned char> bytes) const {
  written_->compare(offset, bytes.size());
  while (!bytes.empty()) {
    const ssize_t result =
        pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (result < 0 && errno == EINTR) continue;
    if (result < 0) fail("read", path_, errno);
    if (result == 0)
      throw IoError(fmt::format("'{}' ends at byte {}; expected more bytes", path_, offset));
    offset += static_cast<std::uint64_t>(result);
    bytes = bytes.subspan(static_cast<std::size_t>(result));
  }
}

void PartFile::commit() {
  refuse_input(output_);  // it may have been read, or linked, meanwhile
  compare();
  if (fsync(descriptor_) != 0) fail("flush", path_, errno);
  const NoSignals until_it_is_gone;
  const int error = rename_to(path_, output_, overwrite_);
  if (error == EEXIST)
    throw IoError(fmt::format("'{}' appeared while '{}' was being written; it was left as it is",
                              output_, path_));
  if (error != 0) fail(fmt::format("rename '{}' to", path_), output_, error);
  let_part_go(path_);
  close(descriptor_);
  descriptor_ = -1;
  sync_folder(folder_of(output_));
}

void write_text_atomically(const std::string& path, std::string_view text, bool overwrite) {
  PartFile part(path, overwrite);
  part.write(text);
  part.commit();
}

}  // namespace tangere
