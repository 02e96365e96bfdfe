// SPDX-License-Identifier: Apache-2.0
// A missing shard is an error for every reader that needs all of them, never a silent gap.
#include "io/dataset/dataset_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <string_view>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/dataset/label_sum.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/files/input_files.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kMostCounted = 1'000'000'000'000;  // episodes of a damaged file
constexpr int kDeepest = 4;                               // nesting of the groups of a demo

/// Matches names like "shard-00042.h5".
bool is_shard(std::string_view name) {
  constexpr std::string_view kBegin = "shard-", kEnd = ".h5";
  if (!name.starts_with(kBegin) || !name.ends_with(kEnd) ||
      name.size() <= kBegin.size() + kEnd.size())
    return false;
  const std::string_view number =
      name.substr(kBegin.size(), name.size() - kBegin.size() - kEnd.size());
  return number.find_first_not_of("0123456789") == std::string_view::npos;
}

/// Compares by number: names with more digits come later.
bool before(const std::string& a, const std::string& b) {
  return std::pair(a.size(), a) < std::pair(b.size(), b);
}

std::vector<std::string> shards_in(const std::string& folder) {
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (is_shard(entry.path().filename().string())) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end(), before);
  return files;
}

/// Empty if the folder cannot be read.
std::vector<std::string> shards_beside(const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  try {
    return shards_in(folder.empty() ? "." : folder.string());
  } catch (const fs::filesystem_error&) {
    return {};
  }
}

std::int64_t count_in(const std::vector<Setting>& settings, const std::string& name) {
  const std::string text = value_of(settings, name);
  std::int64_t count = 0;
  std::from_chars(text.data(), text.data() + text.size(), count);
  return count;
}

/// Compares the files with the number of shards in the settings.
void count_shards(DatasetFiles& dataset) {
  const std::int64_t count = count_in(dataset.settings, "dataset_shards");
  if (count < 1 || count > kMostShards)
    throw IoError(fmt::format("'{}' counts {} shards; expected 1 to {}", dataset.files.front(),
                              count, kMostShards));
  auto file = dataset.files.begin();
  for (std::int64_t shard = 0; shard < count; ++shard) {
    const std::string path =
        (fs::path(dataset.folder) / fmt::format("shard-{:05}.h5", shard)).string();
    for (; file != dataset.files.end() && before(*file, path); ++file)
      dataset.surplus.push_back(*file);
    if (file != dataset.files.end() && *file == path)
      ++file;
    else
      dataset.missing.push_back(path);
  }
  dataset.surplus.insert(dataset.surplus.end(), file, dataset.files.end());
}

struct HeldEpisodes {
  std::string file;
  std::int64_t shard = 0;  ///< that its name says
  EpisodeRange there;
};

/// What shards say that they hold. Leaves out files that cannot be read.
std::vector<HeldEpisodes> held_episodes(const DatasetFiles& dataset) {
  std::vector<HeldEpisodes> held;
  for (const std::string& file : dataset.files) {
    const std::string stem = fs::path(file).stem().string();
    HeldEpisodes one{file, 0, {}};
    const std::size_t dash = stem.find('-') + 1;
    std::from_chars(stem.data() + dash, stem.data() + stem.size(), one.shard);
    try {
      const h5::Id there = h5::open_file(file);
      const auto first = h5::read_number<std::int64_t>(there, "first_episode"),
                 count = h5::read_number<std::int64_t>(there, "episodes");
      if (first < 0 || count < 0 || first > kMostCounted || count > kMostCounted) continue;
      one.there = {first, first + count};
    } catch (const IoError&) {
      continue;
    }
    held.push_back(one);
  }
  return held;
}

/// File and message of shards that hold other episodes than their numbers say. Episodes are shared
/// out by the number of shards or by their size, so the way that more files agree with counts.
std::vector<std::pair<std::string, std::string>> misplaced_episodes(const DatasetFiles& dataset) {
  DatasetLayout layout;
  layout.episodes = count_in(dataset.settings, "dataset_episodes");
  layout.shards = count_in(dataset.settings, "dataset_shards");
  if (dataset.folder.empty() || layout.shards < 1 || layout.episodes < 1 ||
      layout.episodes > kMostCounted)
    return {};
  std::int64_t most = 0;
  const std::vector<HeldEpisodes> held = held_episodes(dataset);
  for (const HeldEpisodes& one : held) most = std::max(most, one.there.end - one.there.first);
  const auto compare = [&](const auto& range_of) {
    std::vector<std::pair<std::string, std::string>> found;
    for (const HeldEpisodes& one : held) {
      if (one.shard < 0 || one.shard >= layout.shards) continue;
      const EpisodeRange expected = range_of(one.shard);
      if (one.there.first != expected.first || one.there.end != expected.end)
        found.emplace_back(
            one.file, fmt::format("holds episodes {} to {}; expected {} to {}", one.there.first,
                                  one.there.end - 1, expected.first, expected.end - 1));
    }
    return found;
  };
  auto found = compare([&](std::int64_t shard) { return layout.shard_episodes(shard); });
  const std::int64_t all = layout.episodes;
  if (found.empty() || most < 1 || (all - 1) / most + 1 != layout.shards) return found;
  auto unequal = compare([&](std::int64_t shard) {
    return EpisodeRange{shard * most, std::min(all, (shard + 1) * most)};
  });
  return unequal.size() <= found.size() ? unequal : found;
}

/// Compares the settings of a file with those of the data set. Damage counts as a difference.
std::vector<std::string> differences_of(const std::string& file,
                                        const std::vector<Setting>& settings) {
  try {
    return differences(read_settings(h5::open_file(file)), settings);
  } catch (const IoError& error) {
    return {error.what()};
  }
}

void add_shape(const h5::Id& group, const std::string& name, const std::string& prefix,
               DatasetSummary& summary) {
  const h5::Id dataset = h5::open_dataset(group, name);
  summary.shapes.emplace_back(
      prefix + name,
      fmt::format("({}) {}", fmt::join(h5::dimensions(dataset), ", "), h5::type_text(dataset)));
}

void add_shapes(const h5::Id& group, const std::string& prefix, int depth,
                DatasetSummary& summary) {
  if (depth > kDeepest)
    throw IoError(fmt::format("'{}': groups are nested deeper than {}", prefix, kDeepest));
  for (const std::string& name : h5::link_names(group)) {
    if (h5::is_dataset(group, name)) {
      add_shape(group, name, prefix, summary);
    } else {
      add_shapes(h5::open_group(group, name), prefix + name + "/", depth + 1, summary);
    }
  }
}

void summarise_file(const std::string& path, DatasetSummary& summary) {
  const h5::Id file = h5::open_file(path), data = h5::open_group(file, "data");
  for (const std::int64_t demo : demo_numbers(data)) {
    const h5::Id group = h5::open_group(data, fmt::format("demo_{}", demo));
    summary.rows += h5::read_number<std::int64_t>(group, "num_samples");
    if (summary.shapes.empty()) add_shapes(group, "", 1, summary);
    ++summary.demos;
    const std::vector<std::string> names = h5::attribute_names(group);
    if (!std::binary_search(names.begin(), names.end(), "success")) continue;
    summary.has_success = true;
    summary.successes += h5::read_number<std::int64_t>(group, "success") != 0 ? 1 : 0;
  }
  summary.failed +=
      static_cast<std::int64_t>(h5::link_names(h5::open_group(file, "failed")).size());
  add_steps(summary.steps, stored_steps(file));
  summary.bytes += fs::file_size(path);
}

}  // namespace

std::string value_of(const std::vector<Setting>& settings, const std::string& name) {
  for (const Setting& setting : settings)
    if (setting.name == name) return setting.value;
  return {};
}

DatasetFiles find_dataset(const std::string& path) {
  DatasetFiles dataset;
  if (!fs::exists(path))
    throw IoError(fmt::format("'{}' does not exist; expected a folder of shards or a file", path));
  if (fs::is_directory(path)) {
    dataset.folder = path;
    dataset.files = shards_in(path);
    if (dataset.files.empty())
      throw IoError(fmt::format("'{}' has no shards; expected files like shard-00000.h5", path));
  } else {
    dataset.files = {path};
  }
  // Shards beside a single file, too: a merged file leads to them.
  for (const std::string& file : dataset.folder.empty() ? shards_beside(path) : dataset.files)
    add_input(file);
  std::string reason;
  for (const std::string& file : dataset.files) {
    try {
      std::vector<Setting> settings = read_settings(h5::open_file(file));
      if (const std::string format = value_of(settings, "format"); format != kFormatName)
        throw IoError(
            fmt::format("'{}' has the format '{}'; expected '{}'", file, format, kFormatName));
      dataset.settings = std::move(settings);
      break;
    } catch (const IoError& error) {
      if (reason.empty()) reason = error.what();
    }
  }
  if (dataset.settings.empty())
    throw IoError(fmt::format("'{}' is not a data set: {}", path, reason));
  if (!dataset.folder.empty()) count_shards(dataset);
  return dataset;
}

void add_merged_inputs(const DatasetFiles& dataset) {
  if (dataset.folder.empty()) return;
  add_input((fs::path(dataset.folder) / "robomimic.hdf5").string());
  std::error_code none_there;
  for (const fs::directory_entry& entry :
       fs::recursive_directory_iterator(fs::path(dataset.folder) / "minari", none_there))
    if (entry.is_regular_file(none_there)) add_input(entry.path().string());
}

void check_complete(const DatasetFiles& dataset) {
  if (!dataset.missing.empty())
    throw IoError(fmt::format(
        "'{}' is missing{}; make it with 'tangere generate … --resume'", dataset.missing.front(),
        dataset.missing.size() == 1
            ? ""
            : fmt::format(", and {} more shards are", dataset.missing.size() - 1)));
  for (const std::string& file : dataset.files) {
    const std::vector<std::string> lines =
        differences(read_settings(h5::open_file(file)), dataset.settings);
    if (!lines.empty())
      throw IoError(fmt::format("'{}' does not belong to the same run as '{}': {}", file,
                                dataset.files.front(), fmt::join(lines, "; ")));
  }
  if (!dataset.surplus.empty())
    throw IoError(fmt::format("'{}' is not one of the {} shards that '{}' counts; remove it",
                              dataset.surplus.front(), value_of(dataset.settings, "dataset_shards"),
                              dataset.files.front()));
  if (const auto misplaced = misplaced_episodes(dataset); !misplaced.empty())
    throw IoError(fmt::format("'{}' {}", misplaced.front().first, misplaced.front().second));
}

namespace {

/// What is wrong with the files that merge makes of shards, if they are there.
std::vector<std::string> merged_problems(const DatasetFiles& dataset) {
  std::vector<std::string> problems;
  std::error_code none;
  const std::string merged = (fs::path(dataset.folder) / "robomimic.hdf5").string();
  if (fs::exists(merged, none)) {
    for (const std::string& line : differences_of(merged, dataset.settings))
      problems.push_back(fmt::format("{}: {}", merged, line));
    if (problems.empty())
      for (const std::string& problem : examine_merged(merged).problems)
        problems.push_back(fmt::format("{}: {}", merged, problem));
  }
  for (const fs::directory_entry& entry :
       fs::recursive_directory_iterator(fs::path(dataset.folder) / "minari", none)) {
    if (entry.path().filename() != "main_data.hdf5") continue;
    try {
      const h5::Id file = h5::open_file(entry.path().string());
      const auto expected = h5::read_number<std::uint64_t>(file, "total_episodes");
      if (const std::size_t found = h5::link_count(file); found != expected)
        problems.push_back(fmt::format("{}: it has {} episodes; expected {}", entry.path().string(),
                                       found, expected));
    } catch (const IoError& error) {
      problems.push_back(fmt::format("{}: {}", entry.path().string(), error.what()));
    }
  }
  return problems;
}

}  // namespace

DatasetReport examine_dataset(const DatasetFiles& dataset) {
  DatasetReport report;
  for (const std::string& file : dataset.missing) report.problems.push_back(file + ": missing");
  for (const std::string& file : dataset.surplus)
    report.problems.push_back(file + ": not one of the shards that are counted");
  for (const auto& [file, problem] : misplaced_episodes(dataset))
    report.problems.push_back(fmt::format("{}: {}", file, problem));
  for (const std::string& file : dataset.files) {
    for (const std::string& line : differences_of(file, dataset.settings))
      report.problems.push_back(fmt::format("{}: {}", file, line));
    const ShardReport shard = examine_shard(file);
    for (const std::string& problem : shard.problems)
      report.problems.push_back(fmt::format("{}: {}", file, problem));
    ++report.shards;
    report.demos += shard.content.demos;
    report.failed += shard.content.failed;
    report.rows += shard.content.rows;
    add_steps(report.steps, shard.content.steps);
    if (shard.problems.empty() && !shard.content.has_label_sum) report.has_label_sums = false;
    report.bytes += fs::file_size(file);
  }
  if (!dataset.folder.empty())
    for (std::string& problem : merged_problems(dataset))
      report.problems.push_back(std::move(problem));
  return report;
}

void check_mask_of(const std::string& path, const std::string& name) {
  try {
    const h5::Id file = h5::open_file(path);
    check_mask(h5::open_dataset(file, "mask/" + name), name);
  } catch (const IoError& error) {
    throw IoError(fmt::format("{}: {}", path, error.what()));
  }
}

DatasetSummary summarise(const DatasetFiles& dataset) {
  DatasetSummary summary;
  for (const std::string& file : dataset.files) summarise_file(file, summary);
  return summary;
}

}  // namespace tangere
