// SPDX-License-Identifier: Apache-2.0
// Times of many threads are compared with that of the one that writes.
#include "apps/generate_report.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "apps/scene_run.hpp"
#include "io/dataset/chunk_codec.hpp"

namespace tangere::apps {
namespace {

std::vector<Failure> failures_of(const EpisodeSummary& summary) {
  std::vector<Failure> failures;
  for (const FailedEpisode& f : summary.failures) failures.push_back({f.episode, f.step, f.status});
  return failures;
}

/// Names the work of many threads on finished blocks. Gradients are computed there, too. Checksums
/// always are, but take the least time.
std::string preparation_of(const Job& job) {
  std::vector<std::string> kinds;
  if (!job.layout.gradients.empty()) kinds.emplace_back("gradients");
  if (has_tiles(job.layout)) kinds.emplace_back("tiles");
  if (job.layout.compression != "none") kinds.emplace_back("compression");
  return kinds.empty() ? "checksums" : fmt::format("{}", fmt::join(kinds, " and "));
}

/// Names the kind of work that kept the two others waiting.
std::string limit_of(const EpisodeSummary& summary, const Job& job) {
  const EpisodeOptions& run = job.run;
  const double simulation = summary.simulation_seconds / run.threads,
               encoding = summary.encoding_seconds / run.threads;
  if (summary.writing_seconds >= std::max(simulation, encoding)) return "writing";
  return simulation >= encoding ? "simulation" : preparation_of(job);
}

/// Shard summary. Other processes may replace shards after the merge.
struct Shards {
  std::vector<std::string> paths;
  std::uintmax_t bytes = 0;

  explicit Shards(const DatasetWriter& output) : paths(output.shards()) {
    for (const std::string& path : paths) bytes += std::filesystem::file_size(path);
  }
};

double rate_of(const EpisodeSummary& summary) {
  return summary.seconds > 0 ? static_cast<double>(summary.environment_steps) / summary.seconds : 0;
}

std::string text_of(const GenerateOptions& options, const Job& job, const JobResult& done,
                    const Shards& shards, const DatasetWriter& output) {
  const EpisodeSummary& summary = done.summary;
  const std::string kept =
      output.kept() == 0
          ? ""
          : fmt::format("kept: {} of them, episodes failed in these: {}{}\n", output.kept(),
                        output.kept_failed(), missed_text(output.kept_steps()));
  return fmt::format(
      "episodes: {}, rows: {}, time: {:.2f} s, {:.0f} env-steps/s with output, "
      "threads: {}\nlimited by {}: simulation {:.2f} s and {} {:.2f} s of all threads, writing "
      "{:.2f} s of one\n{}\n{}, episodes failed: {}\n{}{}wrote {}: {} ({} bytes)",
      summary.episodes, summary.rows, summary.seconds, rate_of(summary), job.run.threads,
      limit_of(summary, job), summary.simulation_seconds, preparation_of(job),
      summary.encoding_seconds, summary.writing_seconds, done.task.line, split_text(summary.counts),
      summary.failures.size(), sleep_text(job.layout.sleep, job.moving_bodies, summary.counts),
      kept, options.output,
      shards.paths.size() == 1 ? "1 shard" : fmt::format("{} shards", shards.paths.size()),
      shards.bytes);
}

/// The times of the run, and what its steps took.
Json work_json(const Job& job, const EpisodeSummary& summary) {
  Json json{{"limited_by", limit_of(summary, job)},
            {"simulation_seconds", summary.simulation_seconds},
            {"encoding_seconds", summary.encoding_seconds},
            {"writing_seconds", summary.writing_seconds},
            {"environment_steps", summary.environment_steps},
            {"environment_steps_per_second", rate_of(summary)},
            {"newton_iterations", summary.counts.newton_iterations}};
  json.update(split_json(summary.counts));
  json["loads_not_carried"] = summary.counts.loads_not_carried;
  json["mean_asleep"] = mean_asleep(job.layout.sleep, summary.counts);
  return json;
}

}  // namespace

int report_shards(const GenerateOptions& options, const Console& console, const Job& job,
                  const JobResult& done, DatasetWriter& output) {
  const EpisodeSummary& summary = done.summary;
  const EpisodeOptions& run = job.run;
  StepCounts all_counts = summary.counts;
  all_counts.simulation_steps += output.kept_steps().taken;
  all_counts.tunnelled_steps += output.kept_steps().tunnelled;
  all_counts.overlapping_steps += output.kept_steps().overlapping;
  const ExitCode code =
      exit_code(console, !summary.failures.empty() || output.kept_failed() > 0, all_counts);
  const Shards shards(output);
  const Merged merged = merge_if_complete(options, output);
  list_failures(console, "episode", failures_of(summary), "--json and the shards name all");
  console.print(text_of(options, job, done, shards, output) + merged.line);
  const Json costly = note_costly_steps(console, integrator_named(job.layout.integrator),
                                        job.layout.accuracy, summary.counts);
  Json result{{"command", "generate"},
              {"exit_code", static_cast<int>(code)},
              {"scene", options.scene},
              {"output", options.output},
              {"shards", shards.paths},
              {"bytes", shards.bytes},
              {"kept", output.kept()},
              {"kept_failed", output.kept_failed()},
              {"kept_tunnelled_steps", output.kept_steps().tunnelled},
              {"kept_overlapping_steps", output.kept_steps().overlapping},
              {"episodes", summary.episodes},
              {"rows", summary.rows},
              {"steps", run.steps},
              {"every", run.every}};
  result.update(settings_json(job.layout));
  result.update(
      {{"threads", run.threads},
       {"peak_blocks_in_flight", summary.peak_blocks_in_flight},
       {"seconds", summary.seconds},
       {"compress", options.compress},
       {"pictures", options.pictures},
       {"tactile", options.tactile},
       {"gradients", job.layout.gradients.empty() ? Json() : Json(job.layout.gradients_of)}});
  result.update(work_json(job, summary));
  result.update({{"costly", costly}, {"failed", failures_json("episode", failures_of(summary))}});
  result.update(done.task.keys);
  result.update(merged.keys);
  console.result(result);
  return code;
}

int report_stopped(const GenerateOptions& options, const Console& console, int signal,
                   std::int64_t episodes, std::int64_t requested, const DatasetWriter& output) {
  return report_stop(
      console, "generate", signal, fmt::format("after {} of {} episodes", episodes, requested),
      fmt::format("complete shards in '{}': {}", options.output, output.shards().size()),
      {{"shards", output.shards()}});
}

}  // namespace tangere::apps
