// SPDX-License-Identifier: Apache-2.0
// What `generate` writes: a folder of HDF5 shards (layout in docs/datasets.md).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "io/dataset/dataset_layout.hpp"

namespace tangere {

struct DatasetOutput {
  std::string folder;
  ExistingShards existing = ExistingShards::refuse;
  /// Shards to make, ascending; others may be made by other processes at the same time. None: all,
  /// alone.
  std::optional<std::vector<std::int64_t>> only = {};
};

/// Deals episodes to shards. A shard gets its name when all its episodes are there and have been
/// read back; destroyed before that, it leaves nothing behind.
class DatasetWriter : public EpisodeSink {
 public:
  /// Creates the folder; touches no shard. Throws InputError for names no file can hold and for
  /// shards to keep that other settings made, naming what differs; IoError when the folder cannot
  /// be written, is being written by another process, has shards that are neither to be kept nor
  /// replaced, or the disk has no room for the data set.
  DatasetWriter(const DatasetOutput& output, const DatasetLayout& layout);
  ~DatasetWriter() override;

  /// Episodes that are to be written, in whole shards; none when all are there.
  [[nodiscard]] const std::vector<EpisodeRange>& missing() const;
  /// Shards of an earlier run that stay, and the failed episodes in them.
  [[nodiscard]] std::int64_t kept() const;
  [[nodiscard]] std::int64_t kept_failed() const;

  /// Compresses, where the layout says so.
  void prepare(const EpisodeRows& rows) override;
  /// The first piece of a run removes the shards of an earlier one, where those are to be replaced.
  void write(const EpisodeRows& rows) override;
  void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures) override;

  /// Paths of the complete shards, kept ones among them, in ascending order.
  [[nodiscard]] std::vector<std::string> shards() const;
  /// Whether the data set is complete and no other process writes into its folder, nor can from now
  /// on: of several that end at the same time, at least one is told so. Nothing may be written
  /// afterwards; where it is not complete, others may.
  [[nodiscard]] bool complete();
  /// Why complete() said no although as many shards as are wanted are there; else empty.
  [[nodiscard]] const std::string& obstacle() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
