// SPDX-License-Identifier: Apache-2.0
// Options of `tangere generate`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace tangere::apps {

struct GenerateOptions {
  std::string scene, output, controls, policy, shard, precision = "mixed", compress = "none",
                                                      pictures = "raw", tactile = "sparse", record;
  std::string gradients = "none", loss, mix, name, program;
  std::optional<std::int64_t> episodes, steps, shards;
  std::optional<int> every, threads;
  std::optional<std::uint64_t> seed;
  std::optional<double> accuracy, tape_memory, noise, program_timeout;
  bool sleep = false;
  bool overwrite = false, resume = false, dry_run = false, no_merge = false, allow_unknown = false;
};

}  // namespace tangere::apps
