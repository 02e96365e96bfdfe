// SPDX-License-Identifier: Apache-2.0
// An existing data set: its files, the shards that are missing, and its settings.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/dataset/dataset_layout.hpp"

namespace tangere {

struct DatasetFiles {
  std::vector<std::string> files;    ///< shards in ascending order, or the one file that was named
  std::vector<std::string> missing;  ///< paths of shards that should be there
  std::vector<std::string>
      surplus;  ///< paths of files that are named like shards but do not belong to the data set
  std::vector<Setting> settings;  ///< of the first file that can be read
  std::string folder;             ///< empty when a file was named
};

/// Returns the value of a setting; empty if there is none of this name.
std::string value_of(const std::vector<Setting>& settings, const std::string& name);

/// Finds the shards of a folder, or a single file. They count as inputs, and so do shards beside a
/// single file. Throws IoError if there are none.
DatasetFiles find_dataset(const std::string& path);

/// Files that a merge made of the folder count as inputs, too (io/files/input_files.hpp).
void add_merged_inputs(const DatasetFiles& dataset);

/// Throws IoError when shards are missing, when shards differ in their settings, when a file has a
/// shard's name but is no shard, or when one holds other episodes than its number says. The message
/// names the first such file.
void check_complete(const DatasetFiles& dataset);

/// Reads everything and reports all that is wrong, each with its file: shards that are missing,
/// surplus, damaged, have other settings or other episodes.
struct DatasetReport {
  std::vector<std::string> problems;
  std::int64_t shards = 0, demos = 0, failed = 0, rows = 0;
  std::optional<EpisodeSteps> steps = EpisodeSteps();  ///< none: an older version wrote a shard
  std::uint64_t bytes = 0;
  bool has_label_sums = true;  ///< false: an older version wrote a shard
};
DatasetReport examine_dataset(const DatasetFiles& dataset);

/// Compares a mask of a merged file with its checksum, if it has one. Throws IoError.
void check_mask_of(const std::string& path, const std::string& name);

/// Metadata of a file.
struct DatasetSummary {
  std::int64_t demos = 0, failed = 0, rows = 0, successes = 0;
  bool has_success = false;
  std::optional<EpisodeSteps> steps = EpisodeSteps();  ///< none: an older version wrote a file
  std::uint64_t bytes = 0;
  std::vector<std::pair<std::string, std::string>>
      shapes;  ///< in the first demo: dataset, "(35, 3) float32"
};
DatasetSummary summarise(const DatasetFiles& dataset);

}  // namespace tangere
