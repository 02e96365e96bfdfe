// SPDX-License-Identifier: Apache-2.0
// Who may write into a folder: one process alone, or several that share it. Nothing is left behind,
// and a killed process loses it.
#pragma once

#include <functional>
#include <string>

namespace tangere {

/// How often a lock that others hold is asked for, and what is done in between.
struct LockPatience {
  int tries = 1;
  std::function<void()> pause = {};

  /// Asks twenty times a second.
  static LockPatience seconds(int seconds);
};

class FolderLock {
 public:
  enum class Kind { shared, alone };

  /// Takes nothing yet. Throws IoError when the folder cannot be opened.
  explicit FolderLock(const std::string& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  /// Whether it is held now; where others hold it, none is, not even the one of before. True on
  /// file systems without locks: there the .part of each file keeps writers apart where that is
  /// possible.
  [[nodiscard]] bool take(Kind kind, const LockPatience& patience = {});
  void let_go();

 private:
  int descriptor_ = -1;
};

}  // namespace tangere
