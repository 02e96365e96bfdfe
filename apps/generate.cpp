// SPDX-License-Identifier: Apache-2.0
// tangere generate: a scene, many episodes on all cores, a folder of shards. Everything is checked
// before the first step.
#include <fmt/format.h>

#include <filesystem>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/memory.hpp"
#include "apps/progress.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "io/dataset_writer.hpp"
#include "kernels/isa.hpp"
#include "tasks/episodes.hpp"

namespace tangere::apps {
namespace {

constexpr std::int64_t kMostEpisodes = 1'000'000'000;
constexpr int kMostInterval = 1'000'000'000;
constexpr int kMostThreads = 4096;

struct Options {
  std::string scene, output, controls, precision = "mixed";
  std::optional<std::int64_t> episodes, steps;
  std::optional<int> every, threads;
  std::optional<std::uint64_t> seed;
  bool overwrite = false, allow_unknown = false;
};

EpisodeOptions episode_options(const Options& options, const Model& model,
                               const ControlProgram& controls) {
  EpisodeOptions run;
  run.episodes = options.episodes.value_or(0);
  run.steps = step_count(options.steps, controls);
  run.every = action_interval(model, options.every.value_or(0));
  run.seed = options.seed.value_or(0);
  run.precision = precision_named(options.precision);
  run.threads = options.threads.value_or(available_threads());
  // One more than can be simulated: a thread need not wait for the one that writes.
  run.blocks_in_flight = run.threads + 1;
  static_cast<void>(action_rows(run));
  check_memory(episode_bytes(model, run), fmt::format("--threads {}", run.threads));
  return run;
}

DatasetLayout make_layout(const Model& model, const Stepper& stepper, const EpisodeOptions& run,
                          const ProgramInfo& info) {
  DatasetDescription description;
  description.episodes = run.episodes;
  description.steps = run.steps;
  description.every = run.every;
  description.seed = run.seed;
  description.precision = to_string(run.precision);
  description.single = run.precision == Precision::mixed;
  description.version = info.version;
  description.instruction_set = kernels::active_isa_name();
  return dataset_layout_from(model, stepper, description);
}

std::vector<Failure> failures_of(const EpisodeSummary& summary) {
  std::vector<Failure> failures;
  for (const FailedEpisode& f : summary.failures) failures.push_back({f.episode, f.step, f.status});
  return failures;
}

int report(const Options& options, const Console& console, const Stepper& stepper,
           const EpisodeOptions& run, const EpisodeSummary& summary,
           const std::vector<std::string>& shards) {
  const ExitCode code = summary.failures.empty() ? kDone : kSomeFailed;
  std::uintmax_t bytes = 0;
  for (const std::string& shard : shards) bytes += std::filesystem::file_size(shard);
  const double rate = static_cast<double>(summary.environment_steps) / summary.seconds;
  list_failures(console, "episode", failures_of(summary), "--json and the shards name all");
  console.print(
      fmt::format("episodes: {}, rows: {}, time: {:.2f} s, {:.0f} env-steps/s with output, "
                  "threads: {}\nsteps split: {}, episodes failed: {}\nwrote {}: {} ({} bytes)",
                  summary.episodes, summary.rows, summary.seconds, rate, run.threads,
                  summary.split_steps, summary.failures.size(), options.output,
                  shards.size() == 1 ? "1 shard" : fmt::format("{} shards", shards.size()), bytes));
  console.result({{"command", "generate"},
                  {"exit_code", static_cast<int>(code)},
                  {"scene", options.scene},
                  {"output", options.output},
                  {"shards", shards},
                  {"bytes", bytes},
                  {"episodes", summary.episodes},
                  {"rows", summary.rows},
                  {"steps", run.steps},
                  {"every", run.every},
                  {"seed", run.seed},
                  {"timestep", stepper.timestep()},
                  {"integrator", to_string(stepper.integrator())},
                  {"tolerance", stepper.tolerance()},
                  {"precision", options.precision},
                  {"instruction_set", kernels::active_isa_name()},
                  {"threads", run.threads},
                  {"peak_blocks_in_flight", summary.peak_blocks_in_flight},
                  {"seconds", summary.seconds},
                  {"environment_steps", summary.environment_steps},
                  {"environment_steps_per_second", rate},
                  {"newton_iterations", summary.newton_iterations},
                  {"split_steps", summary.split_steps},
                  {"failed", failures_json("episode", failures_of(summary))}});
  return code;
}

int generate(const Options& options, const Console& console, const ProgramInfo& info) {
  static_cast<void>(
      precision_named(options.precision));  // a wrong word is said before a scene is read
  const Model model(read_scene_for(options.scene, options.allow_unknown, console));
  const Stepper stepper(model);
  const ControlProgram controls =
      make_controls(options.controls, options.seed.value_or(0), model, stepper, console);
  const EpisodeOptions run = episode_options(options, model, controls);

  // Before the folder is made and until it is gone or complete: nothing half-written stays.
  const StopSignals signals;
  DatasetWriter output(options.output, make_layout(model, stepper, run, info), options.overwrite);
  console.detail(fmt::format("episodes: {}, steps: {}, a row every {}, threads: {}", run.episodes,
                             run.steps, run.every, run.threads));
  EpisodeSummary summary;
  {
    Progress progress(console, "environment step", run.episodes * run.steps, 1);
    summary = run_episodes(
        model, {}, controls, run, output, [&](std::int64_t done) { progress.update(done); },
        [&] { return signals.received() != 0; });
  }
  if (summary.stopped)
    return report_stop(
        console, "generate", signals.received(),
        fmt::format("after {} of {} episodes", summary.episodes, run.episodes),
        fmt::format("complete shards in '{}': {}", options.output, output.shards().size()),
        {{"shards", output.shards()}});
  return report(options, console, stepper, run, summary, output.shards());
}

}  // namespace

Command add_generate(CLI::App& program) {
  const auto options = std::make_shared<Options>();
  const auto console = std::make_shared<Console>();
  Options& o = *options;
  CLI::App* app =
      program.add_subcommand("generate", "Run many episodes of a scene and write a data set");
  add_text(*app, "SCENE", o.scene, "", "Scene file (XML)")->required();
  add_text(*app, "-o,--output", o.output, "DIR", "Folder to write shards into")->required();
  add_whole_number<std::int64_t>(*app, "--episodes", o.episodes, 1, kMostEpisodes,
                                 "Episodes to simulate")
      ->required();
  add_text(*app, "--controls", o.controls, "U.csv",
           "Table of controls, a row per step, instead of the scene's <control>");
  add_whole_number<std::int64_t>(*app, "--steps", o.steps, 1, kMostSteps,
                                 "Steps of an episode [default: as many as the controls last]");
  add_whole_number<int>(*app, "--every", o.every, 1, kMostInterval,
                        "A row every N-th step, its action held [default: the sensors', or 1]");
  add_whole_number<int>(*app, "--threads", o.threads, 1, kMostThreads,
                        "Threads to run on [default: one per core]");
  add_text(*app, "--precision", o.precision, "NAME",
           "Of tactile fields: double, or mixed, stored as float32 [default: mixed]");
  add_whole_number<std::uint64_t>(*app, "--seed", o.seed, 0, UINT64_MAX,
                                  "Seed of all that varies between episodes [default: 0]");
  app->add_flag("--overwrite", o.overwrite, "Replace the shards in the folder");
  app->add_flag("--allow-unknown", o.allow_unknown,
                "Unknown elements and attributes of the scene are warnings, not errors");
  add_console_options(*app, *console);
  app->footer(
      "Example:\n"
      "  tangere generate scenes/rolling_ball_small.xml --output balls --episodes 32 --seed 1");
  return {app, [=](const ProgramInfo& info) { return generate(*options, *console, info); }};
}

}  // namespace tangere::apps
