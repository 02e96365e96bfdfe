// SPDX-License-Identifier: Apache-2.0
// Checks whether a shard holds what its writer was given: counts, shapes, a checksum of all
// numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/rows/episode_sink.hpp"

namespace tangere {

struct ShardContent {
  std::int64_t first_episode = 0;
  std::int64_t demos = 0, failed = 0;  ///< episodes below /data and below /failed
  std::int64_t rows = 0;               ///< of all demos
  std::optional<EpisodeSteps> steps;   ///< of all episodes; none: an older version wrote the shard
  bool has_label_sum = false;          ///< false: an older version wrote the shard
};

struct ShardReport {
  ShardContent content;
  std::vector<std::string> problems;  ///< each with its dataset; at most a hundred
};

/// Reads a whole shard and reports all that is wrong with it, including numbers that are not
/// finite. A file that cannot be read is a problem in the report, not an exception.
ShardReport examine_shard(const std::string& path);

/// The same of a merged file, without the numbers that it links. Those of a copy are read.
ShardReport examine_merged(const std::string& path);

/// Reads a whole shard. Throws IoError naming the file and what is missing or differs.
ShardContent check_shard(const std::string& path);

/// Counts all episodes and reads the first and the last one. It checks that a shard whose bytes
/// were compared before forms a data set. Throws IoError like check_shard().
void sample_shard(const std::string& path);

}  // namespace tangere
