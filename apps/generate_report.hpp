// SPDX-License-Identifier: Apache-2.0
// Output of `tangere generate` about its shards.
#pragma once

#include "apps/console.hpp"
#include "apps/generate_job.hpp"
#include "io/dataset/dataset_writer.hpp"

namespace tangere::apps {

/// Merges a complete data set, prints a summary and returns the exit code.
int report_shards(const GenerateOptions& options, const Console& console, const Job& job,
                  const JobResult& done, DatasetWriter& output);

/// Prints that a signal stopped the run, and returns the exit code. `requested`: number of requested
/// episodes.
int report_stopped(const GenerateOptions& options, const Console& console, int signal,
                   std::int64_t episodes, std::int64_t requested, const DatasetWriter& output);

}  // namespace tangere::apps
