// SPDX-License-Identifier: Apache-2.0
// One HDF5 file of a data set: all places are fixed block by block in ascending order, then filled
// in any order, so that its bytes do not depend on the order in which blocks are finished.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "engine/episode_sink.hpp"
#include "io/chunk_codec.hpp"
#include "io/dataset_layout.hpp"
#include "io/h5.hpp"
#include "io/part_file.hpp"
#include "io/shard_check.hpp"

namespace tangere {

class ShardFile {
 public:
  /// Creates `<path>.part`. Throws IoError, also when `path` exists and `overwrite` is false. `layout` must outlive it.
  ShardFile(const std::string& path, const DatasetLayout& layout, EpisodeRange range, bool overwrite);
  ~ShardFile();
  ShardFile(const ShardFile&) = delete;
  ShardFile& operator=(const ShardFile&) = delete;

  /// `chunks`: of the same piece, where the layout compresses.
  void write(const EpisodeRows& rows, std::span<const CompressedChunk> chunks);
  void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures);
  /// Whether every block has finished.
  [[nodiscard]] bool complete() const { return unfinished_ == 0; }
  /// Moves failed episodes out of /data, closes, reads everything back, syncs and renames.
  void commit();

 private:
  /// The open datasets of one episode.
  struct Demo {
    h5::Id group;
    h5::Id actions;
    h5::Id rewards;
    std::vector<h5::Id> obs, final_obs;  // per observation
    std::vector<h5::Id> gradients;       // per array
    std::int64_t length = 0;             // actions
    std::vector<double> randomized;
    ContentSum sum;
  };
  using Block = std::vector<Demo>;

  void describe();
  void create_block(std::int64_t first_episode, std::span<const EpisodeEnd> ends);
  Demo create_demo(std::int64_t episode, const EpisodeEnd* end);
  void write_randomized(Demo& demo, const EpisodeRows& rows, int episode) const;
  void write_rewards(Demo& demo, const EpisodeRows& rows, int episode);
  void write_observation(Demo& demo, const EpisodeRows& rows, int episode, std::size_t name);
  void create_gradients(Demo& demo) const;
  void write_gradients(Demo& demo, const EpisodeRows& rows, int episode) const;
  [[nodiscard]] bool compresses_last(std::size_t name) const;
  void record_failures();

  const DatasetLayout& layout_;
  std::int64_t first_episode_, end_, created_;  // created_: the first episode without a place
  std::int64_t unfinished_;                     // blocks
  std::vector<std::string> names_;
  std::vector<std::vector<std::uint64_t>> shapes_;
  std::vector<std::int64_t> rows_of_chunks_;
  PartFile part_;
  h5::Id file_, data_;
  std::map<std::int64_t, Block> blocks_;  // unfinished ones, by their first episode
  std::vector<FailedEpisode> failures_;
  std::map<std::int64_t, std::vector<double>> randomized_of_failures_;  // by episode
  std::int64_t rows_ = 0;  // of demos, failed ones left out
  ContentSum sum_;
};

}  // namespace tangere
