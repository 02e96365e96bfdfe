// SPDX-License-Identifier: Apache-2.0
// A data set that was requested, checked and is ready to be made. One call hides the differences
// between scenes and tasks.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/generate_options.hpp"
#include "apps/stop_signals.hpp"
#include "apps/task_report.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "tasks/gradients/episode_gradients.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere::apps {

struct JobResult {
  EpisodeSummary summary;
  TaskReport task;
};

struct Job {
  DatasetLayout layout;
  EpisodeOptions run;
  double memory_bytes = 0;           ///< of the simulation, without the program itself
  std::string unit;                  ///< what progress counts: "environment step", "action"
  std::vector<std::string> effects;  ///< that are switched on
  int moving_bodies = 0;
  std::function<JobResult(const EpisodeOptions&, EpisodeSink&, const ProgressCallback&,
                          const std::stop_token&)>
      simulate;
};

/// Returns what --gradients and its companions request. Throws InputError for options that do not
/// go together.
GradientKind requested_gradients(const GenerateOptions& options, bool is_task);
/// Size of the tapes of one thread [bytes].
double tape_bytes(const GenerateOptions& options, int threads);

/// Which shards this process makes, and what happens to existing ones. Prints a note if the process
/// is not alone.
DatasetOutput output_for(const GenerateOptions& options, const DatasetLayout& layout,
                         const Console& console);

/// The merged files of a complete data set: paths for the JSON object, null if the set is not
/// complete or merging was not requested, and the reason if all shards seem to exist.
struct Merged {
  Json keys{
      {"merged", nullptr}, {"minari_id", nullptr}, {"not_merged", nullptr}, {"touching", nullptr}};
  std::string line;
};
Merged merge_if_complete(const GenerateOptions& options, DatasetWriter& output);

/// Prints what would be made and how long it may take. It simulates some episodes for this, and
/// writes nothing.
int dry_run(const GenerateOptions& options, const Console& console, const Job& job,
            const StopSignals& signals);

}  // namespace tangere::apps
