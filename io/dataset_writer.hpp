// SPDX-License-Identifier: Apache-2.0
// What `generate` writes: a folder of HDF5 shards (layout in docs/datasets.md).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/episode_sink.hpp"
#include "io/dataset_layout.hpp"

namespace tangere {

/// Deals episodes to shards. A shard gets its name when all its episodes are there and have been
/// read back; destroyed before that, it leaves nothing behind.
class DatasetWriter : public EpisodeSink {
 public:
  /// Creates the folder; touches no shard. Throws InputError for names no file can hold, IoError
  /// when the folder cannot be written, is being written by another process, has shards (and
  /// `overwrite` is false), or the disk has no room for the data set.
  DatasetWriter(const std::string& folder, const DatasetLayout& layout, bool overwrite);
  ~DatasetWriter() override;

  /// The first piece of a run removes the shards of an earlier one.
  void write(const EpisodeRows& rows) override;
  void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures) override;

  /// Paths of the complete shards, in ascending order.
  [[nodiscard]] std::vector<std::string> shards() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
