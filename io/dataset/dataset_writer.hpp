// SPDX-License-Identifier: Apache-2.0
// Writes what `generate` makes: a folder of HDF5 shards (layout in docs/datasets.md).
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
  /// Shards to make, ascending. Other processes may make the others at the same time. None: this
  /// process makes all shards alone.
  std::optional<std::vector<std::int64_t>> only = {};
};

/// Writes each episode to its shard. A shard is a temporary file until all its episodes have been
/// written and read back; then it gets its name. Temporary files that are left are removed by the
/// destructor. Functions that read or write throw IoError when they cannot.
class DatasetWriter : public EpisodeSink {
 public:
  /// Creates the folder, and changes no shard in it. Throws InputError for names that no file can
  /// hold, and for shards to keep that have other settings, naming what differs. Throws IoError if
  /// the folder cannot be written, another process writes it, it has shards that are neither to be
  /// kept nor replaced, or the disk has no room for the data set.
  DatasetWriter(const DatasetOutput& output, const DatasetLayout& layout);
  ~DatasetWriter() override;

  /// Episodes to write, in whole shards; none if all shards exist.
  [[nodiscard]] const std::vector<EpisodeRange>& missing() const;
  /// Shards kept from an earlier run, the failed episodes in them, and the steps of all theirs.
  [[nodiscard]] std::int64_t kept() const;
  [[nodiscard]] std::int64_t kept_failed() const;
  [[nodiscard]] const EpisodeSteps& kept_steps() const;

  /// Compresses the piece if the layout says so.
  void prepare(const EpisodeRows& rows) override;
  /// The first piece of a run removes the shards of an earlier run, if those are to be replaced.
  void write(const EpisodeRows& rows) override;
  void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures,
              const EpisodeSteps& steps) override;

  /// Paths of the complete shards, kept ones among them, in ascending order.
  [[nodiscard]] std::vector<std::string> shards() const;
  /// Whether the data set is complete and no other process writes into its folder or can do so from
  /// now on. Of several processes that end at the same time, at least one gets true. Do not write
  /// afterwards. If the data set is not complete, other processes may write.
  [[nodiscard]] bool complete();
  /// Why complete() returned false although all shards exist; else empty.
  [[nodiscard]] const std::string& obstacle() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
