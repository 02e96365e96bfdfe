// SPDX-License-Identifier: Apache-2.0
// The folder of a data set: one process at a time, shards of one run only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/dataset_layout.hpp"
#include "io/files/folder_lock.hpp"

namespace tangere {

/// For those who share a folder: until the one that merges has ended, until nobody who looks at it
/// is in the way of merging.
struct FolderPatience {
  LockPatience to_share = LockPatience::seconds(10), to_be_alone = LockPatience::seconds(1);
};

class DatasetFolder {
 public:
  /// Creates the folder when it is missing, and holds it against other processes; `shared`: against
  /// those alone that want it for themselves. Removes what a killed run or merge left unfinished,
  /// shards of others that share it excepted. Throws IoError when it is something else, cannot be
  /// written, is held by another process, or is not shared and has shards that it should not have.
  DatasetFolder(std::string path, ExistingShards existing, bool shared = false,
                FolderPatience patience = {});
  /// Removes the folder if it was created here and nothing came into it.
  ~DatasetFolder();
  DatasetFolder(const DatasetFolder&) = delete;
  DatasetFolder& operator=(const DatasetFolder&) = delete;

  /// Lets go of a shared folder, for good; others may go on writing.
  void let_go();
  /// Whether this process holds the folder alone, or could from now on.
  [[nodiscard]] bool hold_alone();
  [[nodiscard]] std::string shard_path(std::int64_t shard) const;
  /// Paths of all that is called like a shard, sorted.
  [[nodiscard]] std::vector<std::string> shards() const { return files_ending(".h5"); }
  /// Space on the disk that shards may fill, those to be removed included [bytes].
  [[nodiscard]] double free_bytes() const;
  /// Where an earlier run is to be replaced, removes what shows its shards as one, then the shards,
  /// last one first, so that what is left begins with 0. In a shared folder, where each shard is
  /// replaced by its own, only those that are none of `count` shards.
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
  std::optional<FolderLock> lock_;  // let go of, however the constructor ends
};

}  // namespace tangere
