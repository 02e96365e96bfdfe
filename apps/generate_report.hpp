// SPDX-License-Identifier: Apache-2.0
// What `tangere generate` says of the shards that it made.
#pragma once

#include "apps/console.hpp"
#include "apps/generate_job.hpp"
#include "io/dataset/dataset_writer.hpp"

namespace tangere::apps {

/// Merges a complete data set, says what was made and returns the exit code.
int report_shards(const GenerateOptions& options, const Console& console, const Job& job,
                  const JobResult& done, DatasetWriter& output);

/// Says that a signal stopped the run, and returns the exit code. `asked`: episodes.
int report_stopped(const GenerateOptions& options, const Console& console, int signal,
                   std::int64_t episodes, std::int64_t asked, const DatasetWriter& output);

}  // namespace tangere::apps
