// SPDX-License-Identifier: Apache-2.0
// tangere generate: plays many episodes of a scene or a task on all cores and writes a folder of
// shards. Everything is checked before the first step.
#include <fmt/format.h>

#include <algorithm>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/generate_job.hpp"
#include "apps/generate_layout.hpp"
#include "apps/generate_report.hpp"
#include "apps/memory.hpp"
#include "apps/policy_program.hpp"
#include "apps/progress.hpp"
#include "apps/record.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "apps/task_run.hpp"
#include "io/dataset/workers.hpp"
#include "io/files/nearest_name.hpp"
#include "io/hdf5/reading_note.hpp"
#include "tasks/gradients/episode_gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/episodes.hpp"

namespace tangere::apps {
namespace {

constexpr std::int64_t kMostEpisodes = 1'000'000'000;
constexpr double kProgramTimeout = 120;  // [s], enough to load a large network

EpisodeOptions episode_options(const GenerateOptions& options, const Model& model,
                               const ControlProgram& controls) {
  EpisodeOptions run;
  run.episodes = options.episodes.value_or(0);
  run.steps = step_count(options.steps, controls);
  run.every = action_interval(model, options.every.value_or(0));
  run.seed = options.seed.value_or(0);
  run.precision = precision_named(options.precision);
  run.threads = options.threads.value_or(available_threads());
  // One more than can be simulated at a time, so that no thread waits for the one that writes.
  run.blocks_in_flight = run.threads + 1;
  static_cast<void>(action_rows(run));
  return run;
}

/// Names of the kinds of effects that the model has on.
std::vector<std::string> effect_names(const Model& model) {
  std::vector<std::string> names;
  for (const EffectInfo& effect : model.effects()) {
    if (effect.on && effect.effect.element < 0) names.emplace_back(effect.name);
  }
  return names;
}

/// The task's report, with the steps of the simulation.
TaskReport report_of(const Task& task, PolicyKind kind, const std::string& player,
                     const EpisodeSummary& summary) {
  const auto played = summary.episodes - static_cast<std::int64_t>(summary.failures.size());
  TaskReport report =
      report_of(task, kind, player, TaskResult{played, summary.successes, summary.mean_return});
  report.keys["simulation_steps"] = summary.counts.simulation_steps;
  return report;
}

/// Throws if the tapes are too small, before anything is made.
GradientPlan checked(GradientPlan plan) {
  if (plan.make) static_cast<void>(plan.make());
  return plan;
}

/// Runs the job, and adds derivatives in between if they were requested.
template <class Run>
auto with_gradients(const GradientPlan& plan, EpisodeSink& sink, const Run& run) {
  if (plan.arrays.empty()) return run(sink);
  GradientSink adding(plan, sink);
  return run(adding);
}

/// Writes the missing shards. `signals` must exist from before the folder is created until it is
/// complete or removed, so that no incomplete file remains.
int make(const GenerateOptions& options, const Console& console, const Job& job,
         const StopSignals& signals) {
  if (options.dry_run) return dry_run(options, console, job, signals);
  DatasetWriter output(output_for(options, job.layout, console), job.layout);
  EpisodeOptions run = job.run;
  run.ranges = output.missing();
  std::int64_t episodes = 0;
  for (const EpisodeRange& range : run.ranges) episodes += range.end - range.first;
  console.detail(
      fmt::format("episodes: {}, steps: {}, a row every {}, threads: {}, shards kept: {}", episodes,
                  run.steps, run.every, run.threads, output.kept()));
  JobResult done;
  if (episodes > 0) {
    const h5::NotReading computing;
    Progress progress(console, job.unit,
                      episodes * (job.layout.task ? job.layout.rows() : run.steps), 1);
    done = job.simulate(
        run, output, [&](std::int64_t steps) { progress.update(steps); }, signals.token());
  }
  if (done.summary.stopped)
    return report_stopped(options, console, signals.received(), done.summary.episodes, episodes,
                          output);
  return report_shards(options, console, job, done, output);
}

PolicyVariation variation_of(const GenerateOptions& options, PolicyKind kind) {
  for (const GivenOption& option : {GivenOption{"--noise", options.noise.has_value()},
                                    GivenOption{"--mix", !options.mix.empty()}})
    if (option.given && kind != PolicyKind::scripted && kind != PolicyKind::program)
      throw InputError(fmt::format("{} with --policy {}; expected scripted or program", option.name,
                                   to_string(kind)));
  return {options.noise.value_or(0), options.mix.empty() ? 0 : random_share_of(options.mix)};
}

PolicyKind policy_kind(const GenerateOptions& options) {
  const std::string program = to_string(PolicyKind::program);
  if (options.program.empty()) {
    if (options.policy == program)
      throw InputError("--policy program without --program; expected both");
    if (options.program_timeout)
      throw InputError("--program-timeout without --program; expected both");
    return policy_named(options.policy, options.controls, PolicyKind::scripted);
  }
  if (!options.policy.empty() && options.policy != program)
    throw InputError(fmt::format("--policy {} with --program; expected program", options.policy));
  if (!options.controls.empty())
    throw InputError("--controls with --program; expected one of them");
  if (options.gradients != "none")
    throw InputError(
        fmt::format("--gradients {} with --program, which would see every episode twice; expected "
                    "another policy",
                    options.gradients));
  return PolicyKind::program;
}

/// Options of a task's episodes.
EpisodeOptions episode_options(const GenerateOptions& options, const Task& task) {
  EpisodeOptions run;
  run.episodes = options.episodes.value_or(0);
  run.every = task.spec().steps_per_action;
  run.steps = static_cast<std::int64_t>(task.spec().horizon) * run.every;
  run.seed = options.seed.value_or(0);
  run.precision = precision_named(options.precision);
  run.threads = options.threads.value_or(available_threads());
  // Includes blocks that wait until an earlier one is written, because episodes differ in length.
  run.blocks_in_flight = 2 * run.threads + 1;
  return run;
}

int generate_task(const GenerateOptions& options, const Console& console, const ProgramInfo& info,
                  const Task& task) {
  refuse_with_task(
      task, {{"--steps", options.steps.has_value()}, {"--every", options.every.has_value()}});
  note_outputs_of(console, task, "stores what it observes; --record chooses among that");
  const PolicyKind kind = policy_kind(options);
  const PolicyVariation variation = variation_of(options, kind);
  const StopSignals signals;  // from before a program starts, so that none outlives this one
  std::optional<PolicyProgram> program;
  if (kind == PolicyKind::program)
    program.emplace(task, options.seed.value_or(0), info.version, options.program,
                    options.program_timeout.value_or(kProgramTimeout),
                    [&signals] { return signals.received() != 0; });
  if (signals.received() != 0)
    return report_stop(console, "generate", signals.received(), "before the first episode");
  const Policy policy =
      program ? Policy(
                    task, program->name(),
                    [&program](const PolicyInputs& inputs, std::span<double> actions) {
                      program->answer(inputs, actions);
                    },
                    variation)
              : make_policy(task, kind, options.controls, variation);
  Job job;
  job.run = episode_options(options, task);
  job.run.record = record_of_task(options.record, task);
  const GradientKind gradients = requested_gradients(options, true);
  const TaskActions actions = [&](const TaskView& view, std::span<const double> observation,
                                  std::span<double> action) {
    policy.act(view, observation, action);
  };
  const auto plan_of = [&](const EpisodeOptions& run) {
    return task_episode_gradients(task, actions, run, gradients, tape_bytes(options, run.threads));
  };
  const GradientPlan plan = checked(plan_of(job.run));
  job.memory_bytes = episode_bytes(task, job.run) + job.run.threads * plan.bytes;
  check_memory(job.memory_bytes, fmt::format("--threads {}", job.run.threads));
  job.unit = "action";
  job.effects = effect_names(task.model());
  job.moving_bodies = task.model().moving_bodies();
  job.layout =
      make_layout(options, task.model(), Stepper(task.model()), job.run, info, plan, &task,
                  {to_string(kind), policy.players(), variation.noise, variation.random_share});
  job.simulate = [&](const EpisodeOptions& run, EpisodeSink& sink, const ProgressCallback& progress,
                     const std::stop_token& stop) -> JobResult {
    const EpisodeSummary summary = with_gradients(plan_of(run), sink, [&](EpisodeSink& to) {
      return run_episodes(task, policy, run, to, progress, stop);
    });
    return {summary, report_of(task, kind, policy.players()[0], summary)};
  };
  return make(options, console, job, signals);
}

/// Whether it may read shards that it did not write itself.
bool meets_other_shards(const GenerateOptions& options) {
  return options.resume || !options.shard.empty() || !worker_from_environment().source.empty();
}

void check_word(const char* what, const std::string& word, const std::vector<std::string>& known) {
  if (std::find(known.begin(), known.end(), word) == known.end())
    throw InputError(fmt::format("unknown {} '{}'{}", what, word, suggestion(word, known)));
}

/// Reports wrong words and options that do not go together before a scene is read. --shard sets the
/// number of shards.
void check(GenerateOptions& options, const Console& console) {
  static_cast<void>(precision_named(options.precision));
  check_word("compression", options.compress, {"none", "deflate", "lz4"});
  static_cast<void>(jpeg_quality_named(options.pictures));
  check_word("kind of tactile fields", options.tactile, {"dense", "sparse"});
  if (options.compress == "lz4")
    console.note(
        "compressed with LZ4: other programs need the HDF5 plug-in for filter 32004 to read it");
  if (options.resume && options.overwrite)
    throw InputError(
        "--resume with --overwrite; expected one of them: keep shards, or replace them");
  if (!options.shard.empty()) {
    const Worker shard = worker_named(options.shard);
    if (options.shards.value_or(shard.count) != shard.count)
      throw InputError(
          fmt::format("--shard {} with --shards {}; expected the same number of shards",
                      options.shard, *options.shards));
    options.shards = shard.count;
  }
}

/// Names observations that learners do not read, because they are not in every row.
void note_samples(const DatasetLayout& layout, const Console& console) {
  std::vector<std::string> names;
  for (const DatasetSample& sample : layout.samples()) names.push_back(sample.name);
  if (!names.empty())
    console.note(fmt::format(
        "not in every row, so below samples, where learners and exports do not see them: {}; with "
        "--every as long as their interval they are in each row",
        fmt::join(names, ", ")));
}

int generate(GenerateOptions options, const Console& console, const ProgramInfo& info) {
  check(options, console);
  // The same for the episodes and their gradients, which play them again.
  SolverOptions requested{.accuracy = options.accuracy, .sleep = options.sleep ? kUsualSleep : 0};
  if (options.gradients != "none") requested.tolerance = kGradientTolerance;
  requested.keep_inert_contacts = options.gradients != "none";
  if (const std::unique_ptr<Task> task = find_task(options.scene, console, requested))
    return generate_task(options, console, info, *task);
  refuse_with_scene(options.scene, {{"--policy", !options.policy.empty()},
                                    {"--program", !options.program.empty()},
                                    {"--noise", options.noise.has_value()},
                                    {"--mix", !options.mix.empty()}});
  const Model model(read_scene_for(options.scene, options.allow_unknown, console, requested));
  warn_about_geometry(console, model);
  const Stepper stepper(model);
  warn_about_steps(console, model, stepper);
  const ControlProgram controls =
      make_controls(options.controls, options.seed.value_or(0), model, stepper, console);
  Job job;
  job.run = episode_options(options, model, controls);
  const Record record = record_of(options.record, model);
  refuse_trajectory_outputs(record, "a data set");
  job.run.record = record.requested;
  const GradientKind gradients = requested_gradients(options, false);
  std::unique_ptr<RolloutLoss> loss;
  if (!options.loss.empty()) loss = make_loss(loss_named(options.loss), model, job.run.every);
  const auto plan_of = [&](const EpisodeOptions& run) {
    return scene_gradients(model, controls, run, gradients, loss.get(),
                           loss ? loss_meaning(loss_named(options.loss)) : "",
                           tape_bytes(options, run.threads));
  };
  const GradientPlan plan = checked(plan_of(job.run));
  job.memory_bytes = episode_bytes(model, job.run) + job.run.threads * plan.bytes;
  check_memory(job.memory_bytes, fmt::format("--threads {}", job.run.threads));
  job.unit = "environment step";
  job.effects = effect_names(model);
  job.moving_bodies = model.moving_bodies();
  job.layout = make_layout(options, model, stepper, job.run, info, plan);
  note_samples(job.layout, console);
  job.simulate = [&](const EpisodeOptions& run, EpisodeSink& sink, const ProgressCallback& progress,
                     const std::stop_token& stop) -> JobResult {
    return {with_gradients(plan_of(run), sink,
                           [&](EpisodeSink& to) {
                             return run_episodes(model, {}, controls, run, to, progress, stop);
                           }),
            {}};
  };
  return make(options, console, job, StopSignals());
}

/// Options of a task's policy.
void add_playing_options(CLI::App& app, GenerateOptions& o) {
  add_controls_option(app, o.controls);
  add_text(app, "--policy", o.policy, "NAME",
           "Policy of a task: random, hold, csv (with --controls), program (with --program) or "
           "scripted [default: csv with --controls, program with --program, else scripted]");
  add_text(app, "--program", o.program, "CMD",
           "Program that chooses a task's actions over its standard input and output");
  add_positive_number(app, "--program-timeout", o.program_timeout,
                      "Longest time of its start and of every answer [s] [default: 120]");
  add_positive_number(app, "--noise", o.noise,
                      "With scripted or program: standard deviation of noise on every number of an "
                      "action, in its unit [default: none]");
  add_text(app, "--mix", o.mix, "random=SHARE",
           "With scripted or program: share of episodes with random actions [default: none]");
}

/// Options of what is stored, and how.
void add_storage_options(CLI::App& app, GenerateOptions& o) {
  start_group(app, "What to store");
  add_precision_option(app, o.precision, ", which stores float32 [default: mixed]");
  add_text(app, "--compress", o.compress, "NAME",
           "Compression of large observations: none, deflate, or lz4, which is faster but needs a "
           "plug-in to read [default: none]");
  add_text(app, "--tactile", o.tactile, "KIND",
           "Storage of large fields: sparse (no tiles of zeros) or dense [default: sparse]");
  add_text(app, "--pictures", o.pictures, "KIND",
           "Storage of pictures in colours: raw, or jpeg:QUALITY from 1 to 100, jpeg is jpeg:95 "
           "[default: raw]");
  add_text(app, "--record", o.record, "LIST",
           "Observations to store, separated by commas: q, v, variables, bodies or bodies.NAME, a "
           "sensor's field (pad), pad.pressure, pad.shear, pad.sum, pad.ideal, pad.markers, "
           "pad.surface, pad.flow, pad.channels, pad.height, pad.rgb or pad.rgb_marker, a camera's "
           "eye.rgb, eye.depth or eye.ids; pad/10 is every 10th step, which within a row makes a "
           "window, and q/final the end alone; of a task its observations and readings of its "
           "sensors [default: the scene's <outputs>, or all but bodies; of a task its "
           "observations]");
  add_text(app, "--gradients", o.gradients, "KIND",
           "Derivatives beside the rows: none, return (of the task's, or of a scene's --loss) or "
           "jacobians (of each row's state by the row before); not with --sleep [default: none]");
  add_text(app, "--loss", o.loss, "NAME",
           "Loss of a scene, with --gradients return: final, path, tactile, shear, variables, "
           "markers, pictures or channels; fields count at rows");
  add_memory_size(
      app, "--tape-memory", o.tape_memory,
      "With --gradients return: memory for the states that all threads keep; with less than all of "
      "them steps are repeated from checkpoints, with the same bits [default: 1GB each]");
}

/// Options of the folder of shards.
void add_shard_options(CLI::App& app, GenerateOptions& o) {
  start_group(app, "Which files");
  add_text(app, "--name", o.name, "NAME",
           "Last part of the data set's id for Minari: at most 100 letters, digits, hyphens and "
           "underscores [default: the policy, with -noise and -random; for a scene, none]");
  add_whole_number<std::int64_t>(
      app, "--shards", o.shards, 1, kMostEpisodes,
      "Files of the data set, in blocks of 16 episodes [default: each below a gigabyte]");
  add_text(app, "--shard", o.shard, "k/S",
           "Make shard k of S alone, k from 0; other processes may make others at the same time "
           "[default: all, or this process's share]");
  add_flag(app, "--resume", o.resume,
           "Keep the shards in the folder and make the rest, if their settings are the same");
  add_flag(app, "--no-merge", o.no_merge,
           "Make shards alone; else the last process that ends does what merge does");
  add_flag(app, "--dry-run", o.dry_run,
           "Print what would be made, and how long it may take. Nothing is written.");
  add_overwrite_option(app, o.overwrite, "Replace the shards in the folder");
}

}  // namespace

Command add_generate(CLI::App& program) {
  const auto options = std::make_shared<GenerateOptions>();
  const auto console = std::make_shared<Console>();
  GenerateOptions& o = *options;
  CLI::App& app = add_command(
      program, "generate", "Run many episodes of a scene or a task and write a data set",
      "tangere generate scenes/rolling_ball_small.xml --output balls --episodes 32 --seed 1");
  add_text(app, "SCENE", o.scene, "", "Scene file (XML), or the name of a task").required();
  start_group(app, "What to simulate");
  add_text(app, "-o,--output", o.output, "DIR", "Folder for shards, made if its parent is there")
      .required();
  add_whole_number<std::int64_t>(app, "--episodes", o.episodes, 1, kMostEpisodes,
                                 "Episodes to simulate")
      .required();
  add_playing_options(app, o);
  add_steps_option(
      app, o.steps,
      "Steps of an episode, a multiple of --every [default: as many as the controls last]");
  add_every_option(app, o.every,
                   "Store a row every N steps and hold its action [default: the sensors', or 1]");
  add_threads_option(app, o.threads, "Threads to run on [default: one per core]");
  add_seed_option(app, o.seed, "Seed of all that varies between episodes [default: 0]");
  add_accuracy_option(app, o.accuracy);
  add_sleep_option(app, o.sleep);
  add_allow_unknown_option(app, o.allow_unknown);
  add_storage_options(app, o);
  add_shard_options(app, o);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo& info) { return generate(*options, *console, info); },
          [options] { return meets_other_shards(*options); }};
}

}  // namespace tangere::apps
