// SPDX-License-Identifier: Apache-2.0
// The folder of a data set: one process at a time, shards of one run only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "io/dataset_layout.hpp"

namespace tangere {

class DatasetFolder {
 public:
  /// Creates the folder when it is missing, and holds it against other processes; `shared`: against those alone that
  /// want it for themselves. Removes what a killed run left unfinished, unless it is shared. Throws IoError when it is
  /// something else, cannot be written, is held by another process, or is not shared and has shards that it should
  /// not have.
  DatasetFolder(std::string path, ExistingShards existing, bool shared = false);
  /// Removes the folder if it was created here and nothing came into it.
  ~DatasetFolder();
  DatasetFolder(const DatasetFolder&) = delete;
  DatasetFolder& operator=(const DatasetFolder&) = delete;

  /// Whether this process holds the folder alone, or could from now on; where others hold it as well, it lets go of it.
  [[nodiscard]] bool hold_alone();
  [[nodiscard]] std::string shard_path(std::int64_t shard) const;
  /// Paths of all that is called like a shard, sorted.
  [[nodiscard]] std::vector<std::string> shards() const { return files_ending(".h5"); }
  /// Space on the disk that shards may fill, those to be removed included [bytes].
  [[nodiscard]] double free_bytes() const;
  /// Removes the shards of an earlier run where they are to be replaced, last one first, so that what is left begins
  /// with 0; before them what shows them as one. Not in a shared folder, where each shard is replaced by its own.
  void remove_old_shards();

 private:
  void hold();
  [[nodiscard]] std::vector<std::string> merged_files() const;
  [[nodiscard]] std::vector<std::string> files_ending(const std::string& suffix) const;

  /// Closed, and with it the lock, however the constructor ends.
  struct Descriptor {
    int number = -1;
    Descriptor() = default;
    ~Descriptor();
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
  };

  std::string path_;
  ExistingShards existing_;
  bool shared_ = false, created_ = false;
  Descriptor descriptor_;
};

}  // namespace tangere
