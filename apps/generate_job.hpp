// SPDX-License-Identifier: Apache-2.0
// A data set that was asked for, checked and ready to be made: what scenes and tasks do differently
// is behind one call.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.hpp"
#include "apps/console.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "tasks/gradients/episode_gradients.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere::apps {

struct GenerateOptions {
  std::string scene, output, controls, policy, shard, precision = "mixed", compress = "none",
                                                      tactile = "dense", record;
  std::string gradients = "none", loss;
  std::optional<std::int64_t> episodes, steps, shards;
  std::optional<int> every, threads;
  std::optional<std::uint64_t> seed;
  std::optional<double> tape_memory;
  bool overwrite = false, resume = false, dry_run = false, no_merge = false, allow_unknown = false;
};

/// What a run of a task adds: keys of the JSON object, a line for people.
struct TaskReport {
  Json keys{{"task", nullptr}};
  std::string line = "no task: every reward is 0";
};

struct JobResult {
  EpisodeSummary summary;
  TaskReport task;
};

struct Job {
  DatasetLayout layout;
  EpisodeOptions run;
  double memory_bytes = 0;           ///< of the simulation, without the program itself
  std::string unit;                  ///< what progress counts: "environment step", "action"
  std::vector<std::string> effects;  ///< that are on
  std::function<JobResult(const EpisodeOptions&, EpisodeSink&, const EpisodeProgress&,
                          const StopRequest&)>
      simulate;
};

/// What --gradients and its companions ask for, of a scene or a task. Throws InputError for what
/// does not go together.
GradientKind gradients_wanted(const GenerateOptions& options, bool of_task);
/// Of one thread's tapes.
double tape_bytes(const GenerateOptions& options, int threads);

/// Shards that this process is to make, and what becomes of those that are there. Says so where it
/// is not alone.
DatasetOutput output_for(const GenerateOptions& options, const DatasetLayout& layout,
                         const Console& console);

/// What a complete data set is shown as: paths for the JSON object, null where it is not complete
/// or not wanted; and why not, where all shards seem to be there.
struct Merged {
  Json keys{{"merged", nullptr}, {"minari_id", nullptr}, {"not_merged", nullptr}};
  std::string line;
};
Merged merge_if_complete(const GenerateOptions& options, DatasetWriter& output);

/// Says what would be made, and how long that may take: some episodes are simulated for it. Writes
/// nothing.
int dry_run(const GenerateOptions& options, const Console& console, const Job& job);

}  // namespace tangere::apps
