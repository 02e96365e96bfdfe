// SPDX-License-Identifier: Apache-2.0
// Names, shapes and sizes of a data set.
#include "io/dataset/dataset_layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <functional>
#include <numeric>
#include <set>

#include "io/files/nearest_name.hpp"

namespace tangere {
namespace {

// For short episodes: creating objects is what costs, and losing a shard should be cheap.
constexpr std::int64_t kMostEpisodes = 4096;
std::int64_t blocks_of(std::int64_t episodes) { return (episodes + kShardBlock - 1) / kShardBlock; }

/// Checks lengths against the limits of the format of a group.
void check_lengths(const std::vector<std::string>& observations) {
  constexpr std::size_t kLongest = 255, kShown = 32, kAll = 65000, kBesidesName = 16;
  std::size_t bytes = 0;
  for (const std::string& name : observations) {
    if (name.size() > kLongest)
      throw InputError(fmt::format(
          "observation '{}…': the name has {} bytes; the name of a dataset has at most {}",
          name.substr(0, kShown), name.size(), kLongest));
    bytes += name.size() + kBesidesName;
  }
  if (bytes > kAll)
    throw InputError(
        fmt::format("the names of {} observations take {} bytes; a group has room for {}",
                    observations.size(), bytes, kAll));
}

/// Whether Minari accepts a character in a name.
bool fits_minari(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
         c == '_';
}

std::string fitted(std::string name) {
  for (char& c : name)
    if (!fits_minari(c)) c = '-';
  return name.empty() ? "dataset" : name;
}

void check_set_name(const std::string& name) {
  constexpr std::size_t kLongest = 100;
  if (name.size() > kLongest || !std::all_of(name.begin(), name.end(), fits_minari))
    throw InputError(fmt::format("--name {}: expected at most {} letters, digits, - and _",
                                 name.substr(0, kLongest), kLongest));
}

}  // namespace

int jpeg_quality_named(const std::string& word) {
  constexpr int kUsual = 95, kMost = 100;
  constexpr std::string_view kBegin = "jpeg:";
  if (word == "raw") return 0;
  if (word == "jpeg") return kUsual;
  int quality = 0;
  const char* const end = word.data() + word.size();
  const bool begins = word.starts_with(kBegin);
  if (begins) {
    const auto [at, error] = std::from_chars(word.data() + kBegin.size(), end, quality);
    if (error != std::errc() || at != end) quality = 0;
  }
  if (quality < 1 || quality > kMost)
    throw InputError(
        fmt::format("pictures '{}'; expected raw, or jpeg:QUALITY with a whole number from 1 to {}",
                    word.substr(0, kBegin.size() + 16), kMost));
  return quality;
}

void check_policy_name(const std::string& who, const std::string& name) {
  constexpr std::size_t kLongest = 64;
  constexpr const char* kTaken[] = {
      "train",          "valid",          "success", "train_success", "valid_success", "touching",
      "train_touching", "valid_touching", "random",  "hold",          "csv",           "scripted"};
  if (name.empty() || name.size() > kLongest ||
      !std::all_of(name.begin(), name.end(), fits_minari) ||
      std::find(std::begin(kTaken), std::end(kTaken), name) != std::end(kTaken))
    throw InputError(fmt::format(
        "{} calls itself '{}'; expected 1 to {} letters, digits, - and _, and no name of a mask",
        who, name.substr(0, kLongest), kLongest));
}

std::string DatasetLayout::dataset_id() const {
  std::string name = set_name;
  if (name.empty() && task)
    name = fmt::format(
        "{}{}{}", fitted(played_by.players.empty() ? played_by.policy : played_by.players[0]),
        played_by.noise > 0 ? "-noise" : "", played_by.random_share > 0 ? "-random" : "");
  return fmt::format("tangere/{}{}{}-v0", fitted(task ? task->name : scene_name),
                     name.empty() ? "" : "/", name);
}

std::vector<std::string> DatasetLayout::action_names() const {
  if (!task) return u_names;
  std::vector<std::string> names;
  for (std::size_t k = 0; k < task->action.size(); ++k)
    names.push_back(fmt::format("{}[{}]", task->action.name, k));
  return names;
}

std::vector<std::string> DatasetLayout::action_units() const {
  if (!task) return u_units;
  return std::vector<std::string>(task->action.size(), task->action.unit);
}

std::vector<std::string> DatasetLayout::observation_names() const {
  std::vector<std::string> names;
  for (const EpisodeChannel& channel : channels())
    if (channel.requested && !channel.times.given()) names.push_back(channel.name);
  return names;
}

std::vector<std::size_t> DatasetLayout::recorded() const {
  const std::vector<EpisodeChannel> all = channels();
  std::vector<std::size_t> places;
  for (std::size_t k = 0; k < all.size(); ++k)
    if (all[k].requested && !all[k].times.given()) places.push_back(k);
  return places;
}

std::vector<DatasetSample> DatasetLayout::samples() const {
  const std::vector<EpisodeChannel> all = channels();
  std::vector<DatasetSample> list;
  for (std::size_t k = 0; k < all.size(); ++k)
    if (all[k].requested && all[k].times.given())
      list.push_back({all[k].name, all[k].shape, all[k].own_bytes(), k, all[k].times,
                      all[k].times.before(rows() + 1, rows())});
  return list;
}

std::vector<std::size_t> DatasetLayout::touch() const {
  std::vector<std::size_t> places;
  std::size_t stored = 0;
  for (const EpisodeChannel& channel : channels()) {
    if (!channel.requested || channel.times.given()) continue;
    if (channel.touch) places.push_back(stored);
    ++stored;
  }
  return places;
}

std::vector<std::vector<std::uint64_t>> DatasetLayout::observation_shapes() const {
  std::vector<std::vector<std::uint64_t>> shapes;
  for (const EpisodeChannel& channel : channels())
    if (channel.requested && !channel.times.given()) shapes.push_back(channel.shape);
  return shapes;
}

std::vector<int> DatasetLayout::observation_windows() const {
  std::vector<int> windows;
  for (const EpisodeChannel& channel : channels())
    if (channel.requested && !channel.times.given()) windows.push_back(channel.window);
  return windows;
}

std::vector<std::size_t> DatasetLayout::observation_bytes() const {
  std::vector<std::size_t> bytes;
  for (const EpisodeChannel& channel : channels())
    if (channel.requested && !channel.times.given()) bytes.push_back(channel.own_bytes());
  return bytes;
}

bool DatasetLayout::has_jpeg() const {
  const std::vector<EpisodeChannel> all = channels();
  return std::any_of(all.begin(), all.end(), [this](const EpisodeChannel& channel) {
    return channel.requested && as_jpeg(channel.shape, channel.own_bytes());
  });
}

double DatasetLayout::episode_bytes() const {
  const std::size_t width = single ? sizeof(float) : sizeof(double);
  const auto size_of = [width](const std::vector<std::uint64_t>& shape, std::size_t own) {
    return static_cast<double>(
        std::accumulate(shape.begin(), shape.end(), own > 0 ? own : width, std::multiplies<>()));
  };
  double row_bytes = 0, sample_bytes = 0;
  const std::vector<std::vector<std::uint64_t>> shapes = observation_shapes();
  const std::vector<std::size_t> own_bytes = observation_bytes();
  for (std::size_t k = 0; k < shapes.size(); ++k) row_bytes += size_of(shapes[k], own_bytes[k]);
  for (const DatasetSample& sample : samples())
    sample_bytes += static_cast<double>(sample.rows) * size_of(sample.shape, sample.own_bytes);
  const double r = static_cast<double>(rows());
  const double action_bytes = static_cast<double>(action_names().size()) * sizeof(float);
  constexpr double kRewardAndDone = sizeof(float) + 1;
  double gradient_bytes = 0;
  for (const GradientArray& array : gradients)
    gradient_bytes += sizeof(double) * static_cast<double>(array.width()) * (array.per_row ? r : 1);
  return (r + 1) * row_bytes + sample_bytes + r * (action_bytes + kRewardAndDone) + gradient_bytes;
}

std::int64_t DatasetLayout::episodes_per_shard() const {
  const double blocks = shard_bytes / (episode_bytes() * kShardBlock);
  constexpr std::int64_t kMostBlocks = kMostEpisodes / kShardBlock;
  return static_cast<std::int64_t>(std::clamp(blocks, 1.0, double{kMostBlocks})) * kShardBlock;
}

std::int64_t DatasetLayout::shard_count() const {
  if (shards > 0) return shards;
  const std::int64_t each = episodes_per_shard();
  return (episodes + each - 1) / each;
}

EpisodeRange DatasetLayout::shard_episodes(std::int64_t shard) const {
  const std::int64_t each = shards == 0 ? episodes_per_shard() : 0;
  const auto first = [&](std::int64_t s) {
    if (shards == 0) return std::min(episodes, s * each);
    return std::min(episodes, s * blocks_of(episodes) / shards * kShardBlock);
  };
  return {first(shard), first(shard + 1)};
}

std::int64_t DatasetLayout::shard_of(std::int64_t episode) const {
  if (shards == 0) return episode / episodes_per_shard();
  // The last shard whose first block, floor(s B / S), is not behind this one.
  return ((episode / kShardBlock + 1) * shards - 1) / blocks_of(episodes);
}

void DatasetLayout::check() const {
  check_set_name(set_name);
  if (shards > blocks_of(episodes))
    throw InputError(
        fmt::format("{} shards of {} episodes; expected at most {}, one for each block of {}",
                    shards, episodes, blocks_of(episodes), kShardBlock));
  if (const std::int64_t count = shard_count(); count > kMostShards)
    throw InputError(fmt::format(
        "{} episodes in {} shards; expected at most {} shards: a data set of fewer episodes, or of "
        "episodes with fewer rows",
        episodes, count, kMostShards));
  std::vector<std::string> all;
  for (const EpisodeChannel& channel : channels()) all.push_back(channel.name);
  for (const TimedName& one : record)
    if (std::find(all.begin(), all.end(), one.name) == all.end())
      throw InputError(
          fmt::format("--record: unknown observation '{}'{}", one.name, suggestion(one.name, all)));
  if (jpeg_quality > 0 && !has_jpeg())
    throw InputError(
        fmt::format("--pictures jpeg:{}: no picture in colours is stored; expected raw, or one of "
                    "them in --record, such as pad.rgb",
                    jpeg_quality));
  check_lengths(all);
  for (const SensorLayout& sensor : sensors) check_sensor_name(sensor.name);
  std::set<std::string> names;
  for (const std::string& name : all)
    if (!task && !names.insert(name).second)
      throw InputError(
          fmt::format("sensor '{}': another observation has this name; expected a name other than "
                      "q, v, variables (of end effectors) and those of other sensors",
                      name));
}

}  // namespace tangere
