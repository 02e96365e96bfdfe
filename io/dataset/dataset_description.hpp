// SPDX-License-Identifier: Apache-2.0
// The settings that all shards of a data set share. They are written into each shard and compared
// before shards are put together. Counts of steps are those of a shard alone.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/dataset_layout.hpp"
#include "io/hdf5/h5.hpp"

namespace tangere {

/// `format_version` of shards that are written. Checks and merges also read two before: 6, which
/// has no checksum of labels (LabelSum) and whose description_sum covers less, and 5, whose
/// checksum of numbers also is another (ContentSum).
inline constexpr std::int64_t kDatasetFormat = 7, kUnlabelledFormat = 6, kWholeRowsFormat = 5;
/// `format` of all of them.
inline constexpr const char* kFormatName = "tangere dataset";

/// Writes the attributes of the root that belong to the whole data set, and the group /scene.
void describe_dataset(const h5::Id& file, const DatasetLayout& layout);

/// Checksum of every attribute of /scene and all below it, and of env_args of /data; since
/// kDatasetFormat also of the numbers of datasets below /scene, and of the root's attributes that
/// all shards share. Throws IoError for attributes that are damaged.
std::uint64_t description_sum(const h5::Id& file);

/// Returns all settings on which the numbers of a data set depend, in a fixed order, from a layout
/// or from a file.
std::vector<Setting> settings_of(const DatasetLayout& layout);
std::vector<Setting> read_settings(const h5::Id& file);

/// Returns one line for each difference: "seed: 9 there, 1 here". For long texts it shows the first
/// lines that differ. Empty when nothing differs.
std::vector<std::string> differences(const std::vector<Setting>& there,
                                     const std::vector<Setting>& here);

/// How a file describes a derivative that each of its demos has.
struct StoredGradient {
  std::string name, meaning;
  bool per_row = false;  ///< a row for each action
};
/// Returns the descriptions by name; most files have none.
std::vector<StoredGradient> stored_gradients(const h5::Id& scene);

/// How a file describes an observation that is not stored at every row.
struct StoredSample {
  std::string name;
  OutputTimes times;      ///< in rows
  std::int64_t rows = 0;  ///< of an episode
};
/// Returns them in the order of the file; most have none. `every`: steps of a row; `rows`: R.
/// Throws IoError for times that contradict them.
std::vector<StoredSample> stored_samples(const h5::Id& scene, std::int64_t every,
                                         std::int64_t rows);

/// A reading of which each row has a window, evenly spaced in time, the last one at the row.
struct StoredWindow {
  std::string name;
  std::int64_t readings = 0;  ///< of a row: the first dimension of its shape
};
/// Returns them in the order of the file; most have none. `every`: steps of a row. Throws IoError
/// for steps that are no divisor of it, and for names that are not stored.
std::vector<StoredWindow> stored_windows(const h5::Id& scene, std::int64_t every);

/// Returns the stored observations that are touch. Throws IoError if /scene has no such list.
std::vector<std::string> stored_touch(const h5::Id& scene);

/// Writes the sums over the episodes of one file as attributes of the root: "simulation_steps",
/// "tunnelled_steps", "overlapping_steps".
void write_steps(const h5::Id& file, const EpisodeSteps& steps);
/// Reads them; none: an older version wrote the file. Throws IoError for counts that contradict
/// each other.
std::optional<EpisodeSteps> stored_steps(const h5::Id& file);
/// Adds those of another file. None if one of the two has none.
void add_steps(std::optional<EpisodeSteps>& sum, const std::optional<EpisodeSteps>& more);

/// Returns the numbers of the demos in an open /data, ascending.
std::vector<std::int64_t> demo_numbers(const h5::Id& data);

}  // namespace tangere
