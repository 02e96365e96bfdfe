// SPDX-License-Identifier: Apache-2.0
// Uses flock on the folder itself. A lock is released before another kind is requested, because
// some file systems would keep the old one otherwise.
#include "io/files/folder_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>

#include "engine/base/error.hpp"

namespace tangere {

LockPatience LockPatience::seconds(int seconds) {
  constexpr int kTriesPerSecond = 20;
  return {seconds * kTriesPerSecond,
          [] { std::this_thread::sleep_for(std::chrono::milliseconds(1000 / kTriesPerSecond)); }};
}

FolderLock::FolderLock(const std::string& folder)
    : descriptor_(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (descriptor_ < 0)
    throw IoError(fmt::format("cannot open '{}': {}", folder, std::strerror(errno)));
}

FolderLock::~FolderLock() { close(descriptor_); }

bool FolderLock::take(Kind kind, const LockPatience& patience) {
  let_go();
  for (int i = 0; i < patience.tries; ++i) {
    if (i > 0 && patience.pause) patience.pause();
    if (flock(descriptor_, (kind == Kind::shared ? LOCK_SH : LOCK_EX) | LOCK_NB) == 0 ||
        errno != EWOULDBLOCK)
      return true;
  }
  return false;
}

void FolderLock::let_go() { flock(descriptor_, LOCK_UN); }

}  // namespace tangere
