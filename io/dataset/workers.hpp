// SPDX-License-Identifier: Apache-2.0
// Determines which share of a data set this process makes if a scheduler started several. The
// processes share only a folder.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tangere {

struct Worker {
  std::int64_t index = 0, count = 1;
  std::string source;  ///< the variables that gave it; empty if none did
};

/// Reads the environment that a scheduler or a launcher gives a process: TANGERE_WORKER and
/// TANGERE_WORKERS; else the task of an array (Slurm, AWS Batch, Grid Engine, LSF, and with
/// TANGERE_WORKERS Kubernetes and PBS) and the process of a parallel program (Open MPI, PMI, srun).
/// If each task of an array starts several processes, all of them count. If nothing is set, the
/// process is alone. Throws InputError, naming the variable, for values that are no index below a
/// count.
Worker worker_from_environment();

/// Reads "k/S". Throws InputError for anything other than 0 <= k < S.
Worker worker_named(const std::string& words);

/// Returns index, index + count, … below `shards`.
std::vector<std::int64_t> shards_of(const Worker& worker, std::int64_t shards);

}  // namespace tangere
