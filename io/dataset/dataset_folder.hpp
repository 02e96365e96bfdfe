// SPDX-License-Identifier: Apache-2.0
// The folder of a data set. One process holds it alone, or several share it. All its shards belong
// to one run.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/dataset_layout.hpp"
#include "io/files/folder_lock.hpp"

namespace tangere {

/// Timeouts: of a process that shares a folder, for the merge of another one; and of a process that
/// needs exclusive access, for readers and for killed processes to end.
struct FolderPatience {
  LockPatience to_share = LockPatience::seconds(10), to_be_alone = LockPatience::seconds(1);
};

class DatasetFolder {
 public:
  /// Creates the folder if it is missing, and locks it exclusively, with `shared` as a shared lock.
  /// Removes incomplete files of a killed run or merge, except shards of others that share the
  /// folder. Throws IoError if the path is no folder, cannot be written, is locked by another
  /// process, or is not shared and has unexpected shards; InputError if a file to replace is an
  /// input (io/files/input_files.hpp).
  DatasetFolder(std::string path, ExistingShards existing, bool shared = false,
                FolderPatience patience = {});
  /// Removes the folder if it was created here and is empty.
  ~DatasetFolder();
  DatasetFolder(const DatasetFolder&) = delete;
  DatasetFolder& operator=(const DatasetFolder&) = delete;

  /// Releases a shared folder for good. Others may go on writing.
  void let_go();
  /// Whether this process holds the folder alone, or could from now on.
  [[nodiscard]] bool hold_alone();
  [[nodiscard]] std::string shard_path(std::int64_t shard) const;
  /// Sorted paths of all files that are named like shards.
  [[nodiscard]] std::vector<std::string> shards() const { return files_ending(".h5"); }
  /// Space on the disk that shards may fill [bytes], including the space of shards to be removed.
  [[nodiscard]] double free_bytes() const;
  /// If an earlier run is to be replaced, removes its merged files, then its shards from the last
  /// to the first, so that the remaining ones start at 0. In a shared folder each process replaces
  /// its own shards, so this removes only shards with numbers beyond `count`.
  void remove_old_shards(std::int64_t count);

 private:
  void hold();
  void clean();
  [[nodiscard]] std::vector<std::string> merged_files(const std::string& suffix = "") const;
  [[nodiscard]] std::vector<std::string> files_ending(const std::string& suffix) const;

  std::string path_;
  ExistingShards existing_;
  bool shared_ = false, created_ = false;
  FolderPatience patience_;
  std::optional<FolderLock> lock_;  // released however the constructor ends
};

}  // namespace tangere
