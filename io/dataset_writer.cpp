// SPDX-License-Identifier: Apache-2.0
// Several shards are open where blocks of the next one overtake the last of one.
#include "io/dataset_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "io/dataset_folder.hpp"
#include "io/shard_file.hpp"

namespace tangere {

struct DatasetWriter::Impl {
  DatasetLayout layout;
  std::int64_t per_shard;
  DatasetFolder folder;
  std::map<std::int64_t, ShardFile> open;
  std::set<std::int64_t> complete;
  bool started = false;

  Impl(const std::string& path, const DatasetLayout& l, bool overwrite)
      : layout((l.check(), l)), per_shard(layout.episodes_per_shard()), folder(path, overwrite) {
    const double needed = layout.episode_bytes() * static_cast<double>(layout.episodes);
    const double available = folder.free_bytes();
    if (needed > available)
      throw IoError(fmt::format("{}: needs at least {:.0f} bytes and the disk has {:.0f} free",
                                path, needed, available));
  }

  ShardFile& shard_of(std::int64_t episode) {
    const std::int64_t shard = episode / per_shard, first = shard * per_shard;
    const auto found = open.find(shard);
    if (found != open.end()) return found->second;
    if (!started) folder.remove_old_shards();
    started = true;
    return open
        .try_emplace(shard, folder.shard_path(shard), layout, first,
                     std::min(per_shard, layout.episodes - first))
        .first->second;
  }
};

DatasetWriter::DatasetWriter(const std::string& folder, const DatasetLayout& layout, bool overwrite)
    : impl_(std::make_unique<Impl>(folder, layout, overwrite)) {}
DatasetWriter::~DatasetWriter() = default;

void DatasetWriter::write(const EpisodeRows& rows) {
  impl_->shard_of(rows.first_episode).write(rows);
}

void DatasetWriter::finish(std::int64_t first_episode, std::span<const FailedEpisode> failures) {
  ShardFile& shard = impl_->shard_of(first_episode);
  shard.finish(first_episode, failures);
  if (!shard.complete()) return;
  shard.commit();
  const std::int64_t number = first_episode / impl_->per_shard;
  impl_->open.erase(number);
  impl_->complete.insert(number);
}

std::vector<std::string> DatasetWriter::shards() const {
  std::vector<std::string> paths;
  for (const std::int64_t shard : impl_->complete) paths.push_back(impl_->folder.shard_path(shard));
  return paths;
}

}  // namespace tangere
