// SPDX-License-Identifier: Apache-2.0
// Several shards may be open at once, because blocks of the next shard may overtake the last of
// one.
#include "io/dataset/dataset_writer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <numeric>
#include <set>
#include <stdexcept>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/dataset/dataset_folder.hpp"
#include "io/dataset/demo_format.hpp"
#include "io/dataset/prepared_piece.hpp"
#include "io/dataset/shard_file.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

std::int64_t number(const h5::Id& file, const char* name) {
  return h5::read_number<std::int64_t>(file, name);
}

}  // namespace

struct DatasetWriter::Impl {
  DatasetLayout layout;
  DatasetOutput output;
  DatasetFolder folder;
  DemoFormat format;
  std::vector<EpisodeRange> missing;
  std::size_t held_bytes = 0;  // in memory of open shards
  std::map<std::int64_t, ShardFile> open;
  std::set<std::int64_t> complete;
  std::mutex prepared_mutex;
  std::map<std::pair<std::int64_t, std::int64_t>, PreparedPiece> prepared;  // by episode and row
  std::int64_t kept = 0, kept_failed = 0;
  EpisodeSteps kept_steps;
  bool started = false;
  std::string obstacle;

  Impl(const DatasetOutput& o, const DatasetLayout& l)
      : layout((l.check(), l)),
        output(o),
        folder(o.folder, o.existing, o.only.has_value()),
        format(layout) {
    if (output.existing != ExistingShards::replace) check_settings();
    // This comes before shards are counted one by one, because a typing mistake may mean
    // billions.
    if (makes_all()) check_space(static_cast<double>(layout.episodes));
    for (const std::int64_t shard : to_make()) inspect_shard(shard);
    double episodes = 0;
    for (const EpisodeRange& range : missing)
      episodes += static_cast<double>(range.end - range.first);
    check_space(episodes);
  }

  /// Whether all shards are to be made.
  [[nodiscard]] bool makes_all() const {
    return !output.only && (output.existing != ExistingShards::keep || folder.shards().empty());
  }

  [[nodiscard]] std::vector<std::int64_t> to_make() const {
    if (output.only) return *output.only;
    std::vector<std::int64_t> all(static_cast<std::size_t>(layout.shard_count()));
    std::iota(all.begin(), all.end(), 0);
    return all;
  }

  /// Compares every existing shard, whichever process made it. A data set belongs to one run.
  void check_settings() const {
    const std::vector<std::string> files = folder.shards();
    if (files.empty()) return;
    const std::vector<Setting> here = settings_of(layout);
    for (const std::string& file : files) {
      const std::vector<std::string> lines = differences(read_settings(h5::open_file(file)), here);
      if (lines.empty()) continue;
      throw InputError(
          fmt::format("'{}' belongs to another run, so this one cannot continue it: {}; use the "
                      "same settings, another folder, or --overwrite",
                      file, fmt::join(lines, "; ")));
    }
  }

  /// An existing shard is complete, because only complete ones get the name.
  void inspect_shard(std::int64_t shard) {
    const EpisodeRange range = layout.shard_episodes(shard);
    const std::string path = folder.shard_path(shard);
    if (output.existing == ExistingShards::replace || !std::filesystem::exists(path)) {
      if (!missing.empty() && missing.back().end == range.first) {
        missing.back().end = range.end;
      } else {
        missing.push_back(range);
      }
      return;
    }
    if (output.existing == ExistingShards::refuse)
      throw IoError(fmt::format(
          "'{}' exists already; give --resume to keep it, or --overwrite to replace it", path));
    const h5::Id file = h5::open_file(path);
    const EpisodeRange there{number(file, "first_episode"),
                             number(file, "first_episode") + number(file, "episodes")};
    if (there.first != range.first || there.end != range.end)
      throw InputError(fmt::format("'{}' holds episodes {} to {}; expected {} to {}", path,
                                   there.first, there.end - 1, range.first, range.end - 1));
    const std::optional<EpisodeSteps> steps = stored_steps(file);
    if (!steps)
      throw InputError(fmt::format(
          "'{}' does not store in how many steps contacts missed bodies, as older versions did "
          "not, "
          "so the exit code of a run that keeps it is unknown; use another folder, or --overwrite",
          path));
    ++kept;
    kept_steps += *steps;
    kept_failed += static_cast<std::int64_t>(h5::link_names(h5::open_group(file, "failed")).size());
    complete.insert(shard);
  }

  /// Whether all shards exist, of this data set or of another one with as many shards.
  [[nodiscard]] bool all_there() const {
    const std::vector<std::string> files = folder.shards();
    if (std::ssize(files) < layout.shard_count()) return false;
    const std::set<std::string> there(files.begin(), files.end());
    for (std::int64_t shard = 0; shard < layout.shard_count(); ++shard)
      if (!there.contains(folder.shard_path(shard))) return false;
    return true;
  }

  /// Describes the first shard that does not belong to this data set; empty if there is none. Other
  /// processes may be about to replace it.
  [[nodiscard]] std::string foreign_shard() const {
    const std::vector<Setting> here = settings_of(layout);
    std::vector<std::string> files = folder.shards();
    for (const std::string& file : files) {
      const std::vector<std::string> lines = differences(read_settings(h5::open_file(file)), here);
      if (!lines.empty())
        return fmt::format("'{}' belongs to another run: {}", file, fmt::join(lines, "; "));
    }
    if (std::ssize(files) == layout.shard_count()) return {};
    for (std::int64_t shard = 0; shard < layout.shard_count(); ++shard)
      std::erase(files, folder.shard_path(shard));
    return fmt::format("'{}' is not one of the {} shards of this run", files.front(),
                       layout.shard_count());
  }

  void check_space(double episodes) const {
    // The size of chunks is not known in advance, and neither is the length of a task's episode.
    const double episode_bytes =
        has_chunks(layout) || layout.has_jpeg()
            ? static_cast<double>(format.data_bytes(layout.task ? 1 : layout.rows()))
            : layout.episode_bytes();
    const double needed = episode_bytes * episodes, available = folder.free_bytes();
    if (needed > available)
      throw IoError(fmt::format("{}: needs at least {:.0f} bytes and the disk has {:.0f} free",
                                output.folder, needed, available));
  }

  ShardFile& shard_of(std::int64_t episode) {
    const std::int64_t shard = layout.shard_of(episode);
    const auto found = open.find(shard);
    if (found != open.end()) return found->second;
    if (!started) folder.remove_old_shards(layout.shard_count());
    started = true;
    const bool replace = output.only && output.existing == ExistingShards::replace;
    return open
        .try_emplace(shard, folder.shard_path(shard), layout, format, layout.shard_episodes(shard),
                     replace, held_bytes)
        .first->second;
  }
};

DatasetWriter::DatasetWriter(const DatasetOutput& output, const DatasetLayout& layout)
    : impl_(std::make_unique<Impl>(output, layout)) {}
DatasetWriter::~DatasetWriter() = default;

const std::vector<EpisodeRange>& DatasetWriter::missing() const { return impl_->missing; }
std::int64_t DatasetWriter::kept() const { return impl_->kept; }
std::int64_t DatasetWriter::kept_failed() const { return impl_->kept_failed; }
const EpisodeSteps& DatasetWriter::kept_steps() const { return impl_->kept_steps; }

void DatasetWriter::prepare(const EpisodeRows& rows) {
  PreparedPiece piece = prepare_piece(impl_->layout, impl_->format, rows);
  const std::lock_guard lock(impl_->prepared_mutex);
  impl_->prepared[{rows.first_episode, rows.first_row}] = std::move(piece);
}

void DatasetWriter::write(const EpisodeRows& rows) {
  decltype(impl_->prepared)::node_type prepared;
  {
    const std::lock_guard lock(impl_->prepared_mutex);
    prepared = impl_->prepared.extract({rows.first_episode, rows.first_row});
  }
  impl_->shard_of(rows.first_episode)
      .write(rows, prepared.empty() ? prepare_piece(impl_->layout, impl_->format, rows)
                                    : std::move(prepared.mapped()));
}

void DatasetWriter::finish(std::int64_t first_episode, std::span<const FailedEpisode> failures,
                           const EpisodeSteps& steps) {
  ShardFile& shard = impl_->shard_of(first_episode);
  shard.finish(first_episode, failures, steps);
  if (!shard.complete()) return;
  shard.commit();
  const std::int64_t number = impl_->layout.shard_of(first_episode);
  impl_->open.erase(number);
  impl_->complete.insert(number);
}

bool DatasetWriter::complete() {
  impl_->folder.let_go();
  // Every process lets go first. So the last one to check finds all shards, and no earlier one
  // blocks it.
  if (!impl_->all_there()) return false;
  if (!impl_->folder.hold_alone()) {
    impl_->obstacle = fmt::format(
        "other processes hold '{0}'; the last of them that makes shards merges, or 'tangere merge "
        "{0}'",
        impl_->output.folder);
    return false;
  }
  if (impl_->all_there()) {
    impl_->obstacle = impl_->foreign_shard();
    if (impl_->obstacle.empty()) return true;
  }
  impl_->folder.let_go();
  return false;
}

const std::string& DatasetWriter::obstacle() const { return impl_->obstacle; }

std::vector<std::string> DatasetWriter::shards() const {
  std::vector<std::string> paths;
  for (const std::int64_t shard : impl_->complete) paths.push_back(impl_->folder.shard_path(shard));
  return paths;
}

}  // namespace tangere
