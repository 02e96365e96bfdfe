// SPDX-License-Identifier: Apache-2.0
// tangere generate: a scene or a task, many episodes on all cores, a folder of shards. Everything is checked
// before the first step.
#include <fmt/format.h>

#include <filesystem>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/memory.hpp"
#include "apps/progress.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "apps/task_run.hpp"
#include "io/dataset_writer.hpp"
#include "kernels/isa.hpp"
#include "tasks/task_episodes.hpp"

namespace tangere::apps {
namespace {

constexpr std::int64_t kMostEpisodes = 1'000'000'000;
constexpr int kMostInterval = 1'000'000'000;
constexpr int kMostThreads = 4096;

struct Options {
  std::string scene, output, controls, policy, precision = "mixed";
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

/// `task`: null for a scene alone.
DatasetLayout make_layout(const Model& model, const Stepper& stepper, const EpisodeOptions& run,
                          const ProgramInfo& info, const Task* task = nullptr, const std::string& policy = {}) {
  DatasetDescription description;
  if (task != nullptr) description.task = task->spec();
  description.policy = policy;
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

/// What a run of a task adds: keys of the JSON object, a line for people.
struct TaskReport {
  Json keys{{"task", nullptr}};
  std::string line = "no task: every reward is 0";
};

TaskReport report_of(const Task& task, PolicyKind policy, const TaskEpisodeSummary& summary) {
  const auto played = summary.run.episodes - static_cast<std::int64_t>(summary.run.failures.size());
  TaskReport report;
  report.keys = {{"task", task.spec().name},
                 {"policy", to_string(policy)},
                 {"successes", summary.successes},
                 {"success_rate", played > 0 ? Json(static_cast<double>(summary.successes) / static_cast<double>(played)) : Json()},
                 {"mean_return", played > 0 ? Json(summary.mean_return) : Json()},
                 {"simulation_steps", summary.simulation_steps}};
  report.line = fmt::format("task {}, policy {}: {} of {} episodes solved, mean return {:.4g}", task.spec().name,
                            to_string(policy), summary.successes, played, summary.mean_return);
  return report;
}

int report(const Options& options, const Console& console, const Stepper& stepper,
           const EpisodeOptions& run, const EpisodeSummary& summary,
           const std::vector<std::string>& shards, const TaskReport& of_task) {
  const ExitCode code = summary.failures.empty() ? kDone : kSomeFailed;
  std::uintmax_t bytes = 0;
  for (const std::string& shard : shards) bytes += std::filesystem::file_size(shard);
  const double rate = static_cast<double>(summary.environment_steps) / summary.seconds;
  list_failures(console, "episode", failures_of(summary), "--json and the shards name all");
  console.print(
      fmt::format("episodes: {}, rows: {}, time: {:.2f} s, {:.0f} env-steps/s with output, "
                  "threads: {}\n{}\nsteps split: {}, episodes failed: {}\nwrote {}: {} ({} bytes)",
                  summary.episodes, summary.rows, summary.seconds, rate, run.threads,
                  of_task.line, summary.split_steps, summary.failures.size(), options.output,
                  shards.size() == 1 ? "1 shard" : fmt::format("{} shards", shards.size()), bytes));
  Json result{{"command", "generate"},
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
                  {"failed", failures_json("episode", failures_of(summary))}};
  result.update(of_task.keys);
  console.result(result);
  return code;
}

int stopped(const Options& options, const Console& console, int signal, std::int64_t episodes, std::int64_t asked,
            const DatasetWriter& output) {
  return report_stop(console, "generate", signal, fmt::format("after {} of {} episodes", episodes, asked),
                     fmt::format("complete shards in '{}': {}", options.output, output.shards().size()),
                     {{"shards", output.shards()}});
}

int generate_task(const Options& options, const Console& console, const ProgramInfo& info, const Task& task) {
  refuse_with_task(task, {{"--steps", options.steps.has_value()}, {"--every", options.every.has_value()}});
  const PolicyKind kind = policy_named(options.policy, options.controls, PolicyKind::scripted);
  const Policy policy = make_policy(task, kind, options.controls);
  TaskEpisodeOptions of_task;
  of_task.episodes = options.episodes.value_or(0);
  of_task.seed = options.seed.value_or(0);
  of_task.precision = precision_named(options.precision);
  of_task.threads = options.threads.value_or(available_threads());
  check_memory(task_episode_bytes(task, of_task), fmt::format("--threads {}", of_task.threads));
  EpisodeOptions run;
  run.episodes = of_task.episodes;
  run.every = task.spec().steps_per_action;
  run.steps = static_cast<std::int64_t>(task.spec().horizon) * run.every;
  run.seed = of_task.seed;
  run.precision = of_task.precision;
  run.threads = of_task.threads;
  const Stepper stepper(task.model());

  const StopSignals signals;
  DatasetWriter output(options.output, make_layout(task.model(), stepper, run, info, &task, to_string(kind)),
                       options.overwrite);
  TaskEpisodeSummary summary;
  {
    Progress progress(console, "action", run.episodes * task.spec().horizon, 1);
    summary = run_task_episodes(
        task, policy, of_task, output, [&](std::int64_t done) { progress.update(done); },
        [&] { return signals.received() != 0; });
  }
  if (summary.run.stopped)
    return stopped(options, console, signals.received(), summary.run.episodes, run.episodes, output);
  return report(options, console, stepper, run, summary.run, output.shards(), report_of(task, kind, summary));
}

int generate(const Options& options, const Console& console, const ProgramInfo& info) {
  static_cast<void>(
      precision_named(options.precision));  // a wrong word is said before a scene is read
  if (const std::unique_ptr<Task> task = find_task(options.scene, console))
    return generate_task(options, console, info, *task);
  refuse_with_scene(options.scene, {{"--policy", !options.policy.empty()}});
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
    return stopped(options, console, signals.received(), summary.episodes, run.episodes, output);
  return report(options, console, stepper, run, summary, output.shards(), {});
}

}  // namespace

Command add_generate(CLI::App& program) {
  const auto options = std::make_shared<Options>();
  const auto console = std::make_shared<Console>();
  Options& o = *options;
  CLI::App* app =
      program.add_subcommand("generate", "Run many episodes of a scene or a task and write a data set");
  add_text(*app, "SCENE", o.scene, "", "Scene file (XML), or the name of a task")->required();
  add_text(*app, "-o,--output", o.output, "DIR", "Folder to write shards into")->required();
  add_whole_number<std::int64_t>(*app, "--episodes", o.episodes, 1, kMostEpisodes,
                                 "Episodes to simulate")
      ->required();
  add_text(*app, "--controls", o.controls, "U.csv",
           "Table of controls, a row per step, instead of the scene's <control>; of a task, of actions");
  add_text(*app, "--policy", o.policy, "NAME",
           "Of a task: random, hold, csv (with --controls) or scripted [default: scripted]");
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
