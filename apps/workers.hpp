// SPDX-License-Identifier: Apache-2.0
// Which share of a data set is this process's, when a scheduler started several. They share nothing
// but a folder.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tangere::apps {

struct Worker {
  std::int64_t index = 0, count = 1;
  std::string source;  ///< variables that said so, empty when none did
};

/// From the environment that mpirun, srun or a Slurm array gives a process; an array of tasks that
/// start several processes each counts all of them. Alone when none is set. Throws InputError,
/// naming the variable, for values that are no index below a count.
Worker worker_from_environment();

/// "k/S". Throws InputError for anything else than 0 <= k < S.
Worker worker_named(const std::string& words);

/// index, index + count, … below `shards`.
std::vector<std::int64_t> shards_of(const Worker& worker, std::int64_t shards);

}  // namespace tangere::apps
