// SPDX-License-Identifier: Apache-2.0
// Computes what is known of a data set before its first step.
#include "apps/generate_job.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "apps/named_value.hpp"
#include "apps/scene_run.hpp"
#include "engine/base/error.hpp"
#include "io/dataset/chunk_codec.hpp"
#include "io/dataset/dataset_merge.hpp"
#include "io/dataset/workers.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;

/// A sink that discards episodes.
class NoSink : public EpisodeSink {
 public:
  void write(const EpisodeRows&) override {}
  void finish(std::int64_t, std::span<const FailedEpisode>, const EpisodeSteps&) override {}
};

struct Extent {
  std::vector<std::string> shards;  // paths
  std::int64_t episodes = 0, kept = 0;
};

/// The shards and episodes that this process would write. Opens and creates nothing. A million
/// shards take a second, so common properties are not recomputed for each.
Extent extent_of(const GenerateOptions& options, const DatasetLayout& layout,
                 const DatasetOutput& output) {
  Extent extent;
  const bool all = !output.only && !options.resume;
  if (all) extent.episodes = layout.episodes;
  const std::string folder = (fs::path(options.output) / "shard-").string();
  for (std::int64_t shard = 0, count = layout.shard_count(); shard < count; ++shard) {
    if (output.only && !std::binary_search(output.only->begin(), output.only->end(), shard))
      continue;
    std::string path = fmt::format("{}{:05}.h5", folder, shard);
    if (options.resume && fs::exists(path)) {
      ++extent.kept;
      continue;
    }
    extent.shards.push_back(std::move(path));
    if (all) continue;
    const EpisodeRange range = layout.shard_episodes(shard);
    extent.episodes += range.end - range.first;
  }
  return extent;
}

/// Environment steps per second. Simulates a first block for each thread, for about a second.
double measured_rate(const Job& job, const std::stop_token& stop) {
  EpisodeOptions some = job.run;
  some.ranges.clear();
  some.episodes = std::min<std::int64_t>(job.run.episodes, 16LL * job.run.threads);
  NoSink sink;
  const bool adjusts_steps = !job.layout.task;  // a task plays whole episodes
  if (adjusts_steps) some.steps = std::min<std::int64_t>(job.run.steps, some.every);
  for (;;) {
    const EpisodeSummary summary = job.simulate(some, sink, {}, stop).summary;
    if (summary.stopped || !adjusts_steps || some.steps >= job.run.steps || summary.seconds > 0.5)
      return static_cast<double>(summary.environment_steps) / summary.seconds;
    some.steps = std::min(job.run.steps, some.steps * 4);
  }
}

/// Free bytes at the nearest folder that exists.
double free_bytes_at(const std::string& path) {
  fs::path folder = fs::absolute(path);
  while (!fs::exists(folder) && folder.has_parent_path() && folder != folder.parent_path())
    folder = folder.parent_path();
  return static_cast<double>(fs::space(folder).available);
}

GradientKind gradient_kind_named(const std::string& name) {
  return named_value("gradients", name,
                     {GradientKind::none, GradientKind::returns, GradientKind::jacobians});
}

/// Whether a data set takes more than its numbers, or what makes it smaller.
const char* size_compared(const DatasetLayout& layout) {
  if (layout.has_jpeg()) return "before pictures and other large observations are compressed";
  if (!has_chunks(layout)) return "at least";
  if (!has_tiles(layout)) return "before compression";
  if (layout.compression == "none") return "before tiles of zeros are left out";
  return "before tiles of zeros are left out and the others compressed";
}

}  // namespace

GradientKind requested_gradients(const GenerateOptions& options, bool is_task) {
  const GradientKind kind = gradient_kind_named(options.gradients);
  if (options.tape_memory && kind != GradientKind::returns)
    throw InputError(fmt::format("--tape-memory with --gradients {}; expected --gradients return",
                                 options.gradients));
  if (!options.loss.empty() && (is_task || kind != GradientKind::returns))
    throw InputError(fmt::format("--loss {} with {}; expected a scene and --gradients return",
                                 options.loss,
                                 is_task ? "a task" : "--gradients " + options.gradients));
  if (!is_task && kind == GradientKind::returns && options.loss.empty())
    throw InputError(
        "--gradients return of a scene, which has no rewards; expected --loss as well");
  return kind;
}

double tape_bytes(const GenerateOptions& options, int threads) {
  return options.tape_memory.value_or(1e9 * threads) / threads;
}

DatasetOutput output_for(const GenerateOptions& options, const DatasetLayout& layout,
                         const Console& console) {
  DatasetOutput output{options.output, ExistingShards::refuse, std::nullopt};
  if (options.resume) output.existing = ExistingShards::keep;
  if (options.overwrite) output.existing = ExistingShards::replace;
  const std::int64_t shards = layout.shard_count();
  if (!options.shard.empty()) {
    output.only = std::vector<std::int64_t>{worker_named(options.shard).index};
    return output;
  }
  const Worker worker = worker_from_environment();
  if (worker.source.empty()) return output;
  output.only = shards_of(worker, shards);
  console.note(fmt::format("process {} of {} ({}): makes {} of {} shards", worker.index,
                           worker.count, worker.source, output.only->size(), shards));
  return output;
}

Merged merge_if_complete(const GenerateOptions& options, DatasetWriter& output) {
  Merged merged;
  if (options.no_merge) return merged;
  if (!output.complete()) {
    if (output.obstacle().empty()) return merged;
    merged.keys["not_merged"] = output.obstacle();
    merged.line = fmt::format("\nnot merged: {}", output.obstacle());
    return merged;
  }
  MergeOptions replace;
  replace.overwrite = true;  // links of an earlier run may lead to other shards
  const MergeResult result = merge_dataset(find_dataset(options.output), replace);
  merged.keys["merged"] = result.file;
  merged.line = fmt::format("\nmerged: {}", result.file);
  if (result.touching) {
    merged.keys["touching"] = *result.touching;
    merged.line += fmt::format(", {} of {} demos feel something", *result.touching, result.demos);
  }
  if (result.minari_id.empty()) return merged;
  merged.keys["minari_id"] = result.minari_id;
  merged.keys["minari_left_out"] = result.minari_left_out;
  merged.line += fmt::format(", {} for Minari", result.minari_id);
  if (!result.minari_left_out.empty())
    merged.line += fmt::format(" (not for it: {})", fmt::join(result.minari_left_out, ", "));
  return merged;
}

int dry_run(const GenerateOptions& options, const Console& console, const Job& job,
            const StopSignals& signals) {
  job.layout.check();
  const Extent extent = extent_of(options, job.layout, output_for(options, job.layout, console));
  const double bytes_per_episode = job.layout.episode_bytes(),
               bytes = bytes_per_episode * static_cast<double>(extent.episodes);
  const double free = free_bytes_at(options.output), rate = measured_rate(job, signals.token());
  if (signals.received() != 0)
    return report_stop(console, "generate", signals.received(), "while it measured");
  // For a task these are actions, if every episode lasts as long as it can.
  const double steps = static_cast<double>(extent.episodes) *
                       static_cast<double>(job.layout.task ? job.layout.rows() : job.layout.steps);
  const double seconds = steps / rate;
  console.print(fmt::format(
      "would make {} episodes of {} steps, {} rows each, in {} (kept: {})\n{:.0f} bytes each, "
      "{:.0f} in all {}; "
      "free on the disk: {:.0f}\nmemory for {} threads: {:.0f} bytes\nabout {:.0f} s of "
      "simulation, at {:.0f} env-steps/s "
      "as measured now, without output\neffects: {}\nnothing was written",
      extent.episodes, job.layout.steps, job.layout.rows(),
      extent.shards.size() == 1 ? "1 shard" : fmt::format("{} shards", extent.shards.size()),
      extent.kept, bytes_per_episode, bytes, size_compared(job.layout), free, job.run.threads,
      job.memory_bytes, seconds, rate, fmt::join(job.effects, ", ")));
  console.result({{"command", "generate"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"dry_run", true},
                  {"scene", options.scene},
                  {"output", options.output},
                  {"shards", extent.shards},
                  {"kept", extent.kept},
                  {"episodes", extent.episodes},
                  {"steps", job.layout.steps},
                  {"every", job.layout.every},
                  {"rows_per_episode", job.layout.rows()},
                  {"bytes_per_episode", bytes_per_episode},
                  {"bytes", bytes},
                  {"free_bytes", free},
                  {"memory_bytes", job.memory_bytes},
                  {"threads", job.run.threads},
                  {"environment_steps_per_second", rate},
                  {"estimated_seconds", seconds},
                  {"effects", job.effects}});
  return kDone;
}

}  // namespace tangere::apps
