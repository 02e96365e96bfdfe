// SPDX-License-Identifier: Apache-2.0
// Metadata of the shards of a data set, and the assignment of episodes to shards. It does not
// depend on threads, folders or the time, so equal options give equal bytes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/rows/episode_channels.hpp"
#include "engine/rows/episode_sink.hpp"
#include "engine/rows/picture_gains.hpp"

namespace tangere {

/// What to do with shards that exist already.
enum class ExistingShards { refuse, replace, keep };

/// A setting of a data set as text.
struct Setting {
  std::string name, value;
};

/// Largest number of shards; bounds the memory for damaged counts.
constexpr std::int64_t kMostShards = 1'000'000;

/// Episodes of a shard are a multiple of it, but for the last: lanes of a block of a batch.
constexpr std::int64_t kShardBlock = 16;

/// Throws InputError unless `name` can name a policy that `who` brings, because it becomes a mask
/// and a part of the data set's id.
void check_policy_name(const std::string& who, const std::string& name);

/// Returns the quality of "jpeg:QUALITY", 95 for "jpeg", or 0 for "raw". Throws InputError for
/// other words.
int jpeg_quality_named(const std::string& word);

/// The policy of the episodes of a task.
struct PlayedBy {
  std::string policy;                ///< as requested: "scripted"
  std::vector<std::string> players;  ///< those that EpisodeEnd::policy counts; none: the policy
  double noise = 0;         ///< standard deviation of what is added to actions, in their unit
  double random_share = 0;  ///< share of the episodes that the random policy plays
};

/// An observation that is not stored at every row. It lies below `samples` of a demo.
struct DatasetSample {
  std::string name;
  std::vector<std::uint64_t> shape;  ///< of a row
  std::size_t own_bytes = 0;         ///< EpisodeChannel::own_bytes()
  std::size_t source = 0;            ///< index in pieces of episodes
  OutputTimes times;                 ///< in rows
  std::int64_t rows = 0;             ///< of an episode
};

struct DatasetLayout : RunFacts {
  std::int64_t episodes = 0;  ///< N, of all shards
  std::int64_t steps = 0;     ///< of an episode
  int every = 1;              ///< K: row j is the state after j K steps
  bool single = false;        ///< observations are float32, else float64
  std::vector<SensorLayout> sensors;
  std::vector<CameraLayout> cameras;
  std::vector<GainedPicture> gained;      ///< whose gains are stored with an episode
  std::vector<std::string> body_names;    ///< of a scene
  std::vector<std::string> actuated;      ///< joints that motors move (actuated_joints)
  PlayedBy played_by;                     ///< of a task
  std::string python_class;               ///< of a task written in Python: "MODULE:CLASS"
  std::string set_name;                   ///< the requested part of dataset_id(); none: as below
  std::string tables = "none";            ///< checksum of the files that the text refers to
  std::string included;                   ///< texts of <include>, as JSON; empty: none
  std::string controls = "of the scene";  ///< or a table, named by its content
  double shard_bytes = 1 << 30;           ///< upper limit of a shard, unless 16 episodes are more
  std::int64_t shards = 0;                ///< number of shards; 0: as shard_bytes determines
  std::string compression =
      "none";                     ///< or "deflate", "lz4", for observations with rows large enough
  int jpeg_quality = 0;           ///< 1 to 100: of pictures in colours; 0: they are stored raw
  bool sparse = true;             ///< parts of large fields that are zero are left out
  std::vector<TimedName> record;  ///< observations to store, with times in steps; none: all
  std::string gradients_of;       ///< the quantity that derivatives are of, in words; empty: none
  std::vector<GradientArray> gradients;  ///< those stored with an episode

  /// The data set's name for Minari: "tangere/TASK/NAME-v0", where NAME is set_name, or else the
  /// policy with "-noise" and "-random" as they apply; "tangere/SCENE-v0" for a scene alone,
  /// "tangere/SCENE/NAME-v0" if it has a set_name. Characters that Minari refuses become "-".
  [[nodiscard]] std::string dataset_id() const;
  /// R: actions of an episode, for a task at most.
  [[nodiscard]] std::int64_t rows() const { return steps / every; }
  /// Names of the numbers of an action.
  [[nodiscard]] std::vector<std::string> action_names() const;
  /// Their units: "m", "rad" of targets of position motors, else "1"; of a task its own.
  [[nodiscard]] std::vector<std::string> action_units() const;
  /// All observations, in the order of pieces of episodes. Throws InputError for times that are no
  /// multiple of K.
  [[nodiscard]] std::vector<EpisodeChannel> channels() const {
    return episode_channels(*this, sensors, cameras, body_names, record, every);
  }
  /// Indices in that list of the observations that are stored at every row, ascending.
  [[nodiscard]] std::vector<std::size_t> recorded() const;
  /// Those that are stored at other times, in the same order.
  [[nodiscard]] std::vector<DatasetSample> samples() const;
  /// Names of the stored observations below obs.
  [[nodiscard]] std::vector<std::string> observation_names() const;
  /// Those of them that are touch, as indices.
  [[nodiscard]] std::vector<std::size_t> touch() const;
  /// Shapes of one row of each stored observation: {nq}, {nv}, {n, 3}, {rows, cols, 3} …
  [[nodiscard]] std::vector<std::vector<std::uint64_t>> observation_shapes() const;
  /// Readings of a row of each stored observation: 1, or a window, which its shape begins with.
  [[nodiscard]] std::vector<int> observation_windows() const;
  /// Whether an observation is stored as JPEG files. `own`: its EpisodeChannel::own_bytes().
  [[nodiscard]] bool as_jpeg(const std::vector<std::uint64_t>& shape, std::size_t own) const {
    return jpeg_quality > 0 && own == 1 && shape.size() == 3 && shape[2] == 3;
  }
  /// Whether any is.
  [[nodiscard]] bool has_jpeg() const;
  /// EpisodeChannel::own_bytes() of each.
  [[nodiscard]] std::vector<std::size_t> observation_bytes() const;
  /// Size of one episode's numbers on disk, without HDF5's own data [bytes]. Pictures count raw.
  [[nodiscard]] double episode_bytes() const;
  /// As many episodes as stay below shard_bytes, a multiple of 16. Depends on the data set alone.
  [[nodiscard]] std::int64_t episodes_per_shard() const;
  [[nodiscard]] std::int64_t shard_count() const;
  /// Whole blocks of 16 episodes. If `shards` is given, the shards' numbers of blocks differ by at
  /// most one.
  [[nodiscard]] EpisodeRange shard_episodes(std::int64_t shard) const;
  [[nodiscard]] std::int64_t shard_of(std::int64_t episode) const;
  /// Throws InputError when a time is no multiple of K, when a sensor's name cannot be a name in a
  /// file, when set_name has characters that Minari refuses, when there are more shards than blocks
  /// or than kMostShards, when an observation to record does not exist, or when there are no
  /// pictures to store as JPEG.
  void check() const;
};

}  // namespace tangere
