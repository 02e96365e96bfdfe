// SPDX-License-Identifier: Apache-2.0
// One file that shows a whole data set, and the view of it that Minari reads.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/dataset_files.hpp"

namespace tangere {

struct MergeOptions {
  bool copy = false;       ///< numbers too, not links to the shards
  bool overwrite = false;  ///< replace the results of an earlier merge
  /// Called between demos; true ends the merge, which then leaves nothing. Empty: never.
  std::function<bool()> stop = {};
};

struct MergeResult {
  std::string file;       ///< FOLDER/robomimic.hdf5
  std::string minari;     ///< FOLDER/minari/<minari_id>; FOLDER/minari is a root for Minari
  std::string minari_id;  ///< `dataset_id` of /scene: tangere/NAME-v0, tangere/TASK/NAME-v0
  std::vector<std::string> minari_left_out;  ///< observations too large for Minari's metadata
  std::int64_t demos = 0, failed = 0, train = 0, valid = 0;
  std::optional<std::int64_t> successes;  ///< demos that solved their task; none for a scene alone
  std::optional<std::int64_t> touching;   ///< demos with contact; none: no touch is stored
  std::optional<EpisodeSteps> steps;      ///< of all episodes; none: an older version made a shard
  std::uint64_t bytes = 0;                ///< of the file
  bool stopped = false;                   ///< nothing was written, all else is empty
};

/// Merges a folder's shards. Opens every member that it links, reads all numbers that it copies.
/// Throws IoError when a shard is missing, damaged or of other settings, when it finds its own
/// output and `overwrite` is false, or cannot write. Each output appears whole or not at all.
MergeResult merge_dataset(const DatasetFiles& dataset, const MergeOptions& options);

}  // namespace tangere
