// SPDX-License-Identifier: Apache-2.0
// Lock of an output folder, exclusive or shared between processes. The lock leaves no file behind
// and is released when the process ends, also when it is killed.
#pragma once

#include <functional>
#include <string>

namespace tangere {

/// How often to retry a lock that others hold, and what to do in between.
struct LockPatience {
  int tries = 1;
  std::function<void()> pause = {};

  /// Tries twenty times a second.
  static LockPatience seconds(int seconds);
};

class FolderLock {
 public:
  enum class Kind { shared, alone };

  /// Does not take the lock yet. Throws IoError when the folder cannot be opened.
  explicit FolderLock(const std::string& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  /// Returns whether the lock is held now. If others hold it, this object holds none, not even its
  /// former one. Returns true on file systems without locks; the .part of each file then keeps
  /// writers apart as far as possible.
  [[nodiscard]] bool take(Kind kind, const LockPatience& patience = {});
  void let_go();

 private:
  int descriptor_ = -1;
};

}  // namespace tangere
