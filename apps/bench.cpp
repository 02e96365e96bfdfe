// SPDX-License-Identifier: Apache-2.0
// tangere bench: measures how fast a scene or a task runs here, by number of threads. Everything is
// checked before the first step.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/bench_report.hpp"
#include "apps/command.hpp"
#include "apps/machine.hpp"
#include "apps/memory.hpp"
#include "apps/named_value.hpp"
#include "apps/record.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "apps/task_run.hpp"
#include "apps/text_output.hpp"
#include "engine/step/stepper.hpp"
#include "kernels/numbers/block.hpp"
#include "kernels/table/isa.hpp"
#include "tasks/accuracy/accuracy_sweep.hpp"
#include "tasks/run/benchmark_run.hpp"

namespace tangere::apps {
namespace {

constexpr int kMostPasses = 1'000'000;
constexpr int kDefaultEnvironments = 256;  // 16 blocks: several per thread on usual machines

struct BenchArguments {
  std::string scene, frames, policy, precision = "mixed", record, svg, csv;
  std::vector<int> threads;
  bool pinned = false;
  std::optional<std::int64_t> steps;
  std::optional<int> environments, every, repeat;
  std::optional<std::uint64_t> seed;
  SolverArguments solver;
  bool error = false, overwrite = false, allow_unknown = false;
};

constexpr int kErrorEnvironments = 32;

/// How far the scene's own setting is off, for the console and as JSON.
struct BenchError {
  std::string text;
  Json json;
};

/// The kind as given, or dense.
FrameKind frames_named(const std::string& name) {
  if (name.empty()) return FrameKind::dense;
  return named_value("frames", name, {FrameKind::dense, FrameKind::compact, FrameKind::none});
}

/// `extra_bytes`: memory of the benchmark besides the batch from which it starts [bytes].
void check_size(const Model& model, int environments, double extra_bytes) {
  const double start = static_cast<double>(model.state_bytes_per_environment()) * environments;
  check_memory(start + extra_bytes, fmt::format("--envs {}", environments));
}

void note_idle_threads(const Console& console, int environments, int most_threads) {
  const int blocks = (environments + kernels::kBlock - 1) / kernels::kBlock;
  if (most_threads > blocks)
    console.note(fmt::format("--envs {}: {} block{} of {} environments keep no more threads busy",
                             environments, blocks, blocks == 1 ? "" : "s", kernels::kBlock));
  if (most_threads > processor_count())
    console.note(fmt::format("{} threads share {} processor{}", most_threads, processor_count(),
                             processor_count() == 1 ? "" : "s"));
}

void print_passes(const Console& console, const BenchRun& run) {
  for (const BenchmarkTime& time : run.result.times)
    console.detail(fmt::format("threads {}: {:.4f} s, CPU {:.4f} s", run.threads, time.seconds,
                               time.cpu_seconds));
}

int report(const BenchArguments& options, const Console& console, const BenchSetting& setting,
           const Model& model, const Json& task_json, const Json& entries) {
  const bool any_failed = !entries.at(0).at("failed").empty();
  const ExitCode code = any_failed ? kSomeFailed : kDone;
  Json result{{"command", "bench"},
              {"exit_code", static_cast<int>(code)},
              {"scene", options.scene},
              {"machine", setting.machine},
              {"seed", options.seed.value_or(0)},
              {"timestep", model.timestep()},
              {"integrator", to_string(model.integrator())},
              {"tolerance", Stepper(model).tolerance()},
              {"accuracy", Stepper(model).accuracy()},
              {"sleep", model.solver().sleep},
              {"svg", options.svg.empty() ? Json() : Json(options.svg)},
              {"csv", options.csv.empty() ? Json() : Json(options.csv)},
              {"runs", entries}};
  result.update(task_json);
  console.result(result);
  return code;
}

/// Compares what the scene's setting gives with a reference, in environments of its own.
BenchError error_of(const BenchArguments& options, const Model& model,
                    const ControlProgram& controls, std::int64_t steps,
                    const std::stop_token& stop) {
  const int environments =
      std::min(options.environments.value_or(kDefaultEnvironments), kErrorEnvironments);
  const Batch start(model, environments, options.seed.value_or(0));
  const FixedEpisodes episodes = scene_episodes(start, controls, steps, sample_interval(model));
  AccuracyOptions of;
  of.quantity = model.sensors().empty() ? AccuracyQuantity::state : AccuracyQuantity::tactile;
  of.threads = 1;
  check_memory(accuracy_bytes(episodes, of.quantity, of.threads), "--error");
  const AccuracyReport report = own_accuracy(episodes, of, {stop, {}, {}});
  const AccuracyReference& reference = report.reference;
  Json json{{"quantity", to_string(of.quantity)},
            {"envs", reference.environments},
            {"reference_error", finite(reference.error)},
            {"resolved", report.resolved},
            {"error", report.resolved ? finite(report.own.error) : Json()},
            {"median_error", report.resolved ? finite(report.own.median) : Json()}};
  if (!report.resolved)
    return {
        fmt::format("error: not resolved; the reference is off by {:.2g} %", 100 * reference.error),
        json};
  return {
      fmt::format("error of the {}: {:.2g} %, not exceeded in 95 % of {} environments",
                  accuracy_meaning(of.quantity), 100 * report.own.error, reference.environments),
      json};
}

BenchSetting setting_of(const BenchArguments& options, const Model& model,
                        const ControlProgram& controls) {
  BenchSetting setting;
  setting.scene = options.scene;
  setting.model = model.scene().name;
  setting.sleep = model.solver().sleep;
  setting.moving_bodies = model.moving_bodies();
  setting.machine = processor_name();
  setting.isa = kernels::active_isa_name();
  setting.options.precision = precision_named(options.precision);
  setting.environments = options.environments.value_or(kDefaultEnvironments);
  setting.options.rollout = {.steps = step_count(options.steps, controls),
                             .every = options.every.value_or(0),
                             .outputs = record_of(options.record, model).outputs};
  setting.options.frames = frames_named(options.frames);
  std::vector<std::string> names;
  for (const FieldOutput of : fields_of(model, setting.options.rollout.outputs)) {
    const auto k = static_cast<std::size_t>(of.sensor);
    const std::string& owner =
        is_view(of.form) ? model.scene().cameras[k].name : model.sensors()[k].name;
    names.push_back(output_name(owner, of.form) + to_string(of.times));
  }
  if (setting.options.frames != FrameKind::none)
    setting.record = fmt::format("{}", fmt::join(names, ","));
  setting.options.repeat = options.repeat.value_or(setting.options.repeat);
  setting.every = common_interval(model, setting.options.rollout);
  return setting;
}

/// Calls `run` with setting.options.threads set to each of `threads` and reports the results.
template <class Run>
int measure(const BenchArguments& options, const Console& console, BenchSetting& setting,
            const std::vector<int>& threads, const Model& model, const Json& task_json,
            const Run& run, const std::function<BenchError(const std::stop_token&)>& error = {}) {
  const StopSignals signals;
  TextOutput svg(options.svg, options.overwrite), csv(options.csv, options.overwrite);
  console.print(bench_heading(setting));
  std::vector<BenchRun> runs;
  Json entries = Json::array();
  for (const int n : threads) {
    setting.options.threads = n;
    runs.push_back({n, run(signals.token())});
    if (runs.back().result.stopped)
      return report_stop(console, "bench", signals.received(),
                         fmt::format("while measuring {} thread{}", n, n == 1 ? "" : "s"));
    entries.push_back(bench_entry(setting, runs.back()));
    console.print(bench_row(runs.back(), runs.front()));
    print_passes(console, runs.back());
  }
  console.print(bench_footing(setting, runs.front()));
  list_failures(console, "environment", failures_of(runs.front()), "--json names all");
  Json more = task_json;
  if (error) {
    const BenchError found = error(signals.token());
    if (signals.received() != 0)
      return report_stop(console, "bench", signals.received(), "while measuring the error");
    console.print(found.text);
    more["own_error"] = found.json;
  }
  if (svg.requested()) svg.write(bench_svg(setting, runs), console);
  if (csv.requested()) csv.write(bench_csv(setting, entries), console);
  return report(options, console, setting, model, more, entries);
}

/// The scene with the scheme, step and tolerance of the options.
Scene scene_of(const BenchArguments& options, const Console& console,
               const SolverOptions& requested) {
  Scene scene = read_scene_for(options.scene, options.allow_unknown, console, requested);
  if (!options.solver.integrator.empty())
    scene.integrator = integrator_named(options.solver.integrator);
  if (options.solver.timestep) scene.timestep = *options.solver.timestep;
  if (options.solver.tolerance) scene.solver.tolerance = options.solver.tolerance;
  return scene;
}

/// The requested thread counts, or the default ones.
std::vector<int> thread_counts(const BenchArguments& options) {
  return options.threads.empty() ? default_thread_counts() : options.threads;
}

int bench_task(const BenchArguments& options, const Console& console, const Task& task) {
  refuse_with_task(task, {{"--every", options.every.has_value()},
                          {"--frames", !options.frames.empty()},
                          {"--record", !options.record.empty()},
                          {"--integrator", !options.solver.integrator.empty()},
                          {"--timestep", options.solver.timestep.has_value()},
                          {"--tol", options.solver.tolerance.has_value()},
                          {"--error", options.error}});
  note_outputs_of(console, task, "is timed with what it observes");
  const PolicyKind kind = policy_named(options.policy, "", PolicyKind::random);
  const Policy policy(task, kind);
  BenchSetting setting;
  setting.scene = options.scene;
  setting.model = "task " + task.spec().name;
  setting.sleep = task.model().solver().sleep;
  setting.moving_bodies = task.model().moving_bodies();
  setting.machine = processor_name();
  setting.isa = kernels::active_isa_name();
  setting.environments = options.environments.value_or(kDefaultEnvironments);
  setting.options.precision = precision_named(options.precision);
  setting.options.frames = task.spec().reads_tactile ? FrameKind::dense : FrameKind::none;
  setting.options.rollout.steps = options.steps.value_or(task.spec().horizon);
  setting.options.repeat = options.repeat.value_or(setting.options.repeat);
  const std::vector<int> threads = thread_counts(options);
  const int most_threads = *std::max_element(threads.begin(), threads.end());
  note_idle_threads(console, setting.environments, most_threads);
  setting.options.threads = most_threads;
  setting.options.pinned = options.pinned;
  check_size(task.model(), setting.environments,
             benchmark_bytes(task, setting.environments, setting.options));
  const Batch start(task.model(), setting.environments, options.seed.value_or(0));
  const Json task_json{{"task", task.spec().name},
                       {"policy", to_string(kind)},
                       {"steps_per_action", task.spec().steps_per_action}};
  return measure(options, console, setting, threads, task.model(), task_json,
                 [&](const std::stop_token& stop) {
                   return run_benchmark(start, task, policy, setting.options, stop);
                 });
}

int bench(const BenchArguments& options, const Console& console) {
  check_outputs(options.svg, options.csv);
  // Reports a wrong word before a scene is read.
  frames_named(options.frames);
  precision_named(options.precision);
  if (!options.solver.integrator.empty()) integrator_named(options.solver.integrator);
  if (options.frames == "none" && !options.record.empty())
    throw InputError("--frames none with --record; expected one of them");
  const SolverOptions requested = options.solver.requested();
  if (const std::unique_ptr<Task> task = find_task(options.scene, console, requested))
    return bench_task(options, console, *task);
  refuse_with_scene(options.scene, {{"--policy", !options.policy.empty()}});
  const Model model(scene_of(options, console, requested));
  if (options.error && model.solver().sleep > 0)
    throw InputError(model.solver().sleep_source.prefix() +
                     "--error where bodies may sleep; expected no sleep: errors are those of the "
                     "scheme (docs/sleeping.md says what sleep adds)");
  const std::uint64_t seed = options.seed.value_or(0);
  const ControlProgram controls(model, model.timestep(), seed);
  if (!model.scene().control && model.nu() > 0)
    console.note("the scene has no <control>: every control is 0");
  const RolloutOutputs recorded = record_of(options.record, model).outputs;
  if (recorded.fields && (recorded.bodies || recorded.end_effectors))
    console.note("bench reads sensors and cameras alone: bodies and variables are left out");
  BenchSetting setting = setting_of(options, model, controls);
  const std::vector<int> threads = thread_counts(options);
  const int most_threads = *std::max_element(threads.begin(), threads.end());
  if (setting.options.frames != FrameKind::none)
    note_empty_sensors(console, model, setting.options.rollout);
  note_idle_threads(console, setting.environments, most_threads);
  setting.options.threads = most_threads;
  setting.options.pinned = options.pinned;
  check_size(model, setting.environments,
             benchmark_bytes(model, setting.environments, setting.options));
  const Batch start(model, setting.environments, seed);

  std::function<BenchError(const std::stop_token&)> error;
  if (options.error)
    error = [&](const std::stop_token& stop) {
      return error_of(options, model, controls, setting.options.rollout.steps, stop);
    };
  return measure(
      options, console, setting, threads, model, {{"task", nullptr}},
      [&](const std::stop_token& stop) {
        return run_benchmark(start, controls, setting.options, stop);
      },
      error);
}

}  // namespace

Command add_bench(CLI::App& program) {
  const auto options = std::make_shared<BenchArguments>();
  const auto console = std::make_shared<Console>();
  BenchArguments& o = *options;
  CLI::App& app =
      add_command(program, "bench", "Measure how fast a scene or a task runs, by threads",
                  "tangere bench scenes/rolling_ball_small.xml --envs 32 --steps 50 --threads 1,2 "
                  "--svg speed.svg");
  add_text(app, "SCENE", o.scene, "", "Scene file (XML), or the name of a task").required();
  add_envs_option(app, o.environments, "Environments, in blocks of 16 [default: 256]");
  add_steps_option(app, o.steps,
                   "Steps of the episode; for a task, actions [default: as many as the controls "
                   "last, or the task's horizon]");
  add_text(app, "--policy", o.policy, "NAME",
           "Policy of a task: random, hold or scripted [default: random]");
  add_whole_numbers(
      app, "--threads", o.threads, 1, kMostThreads,
      "Thread counts to measure, each once [default: 1,2,4,... up to the processors]");
  add_flag(app, "--pin", o.pinned, "Keep thread k on the k-th processor that the process may use");
  add_precision_option(app, o.precision, " (points and readings in float) [default: mixed]");
  add_every_option(app, o.every);
  add_text(app, "--frames", o.frames, "NAME",
           "Fields to read: dense (every point), compact (tiles of 8 x 8 that something touches) "
           "or none [default: dense]");
  add_text(
      app, "--record", o.record, "LIST",
      "Readings to take, separated by commas: a sensor's field (pad), pad.pressure, "
      "pad.shear, pad.sum, pad.ideal, pad.markers, pad.surface, pad.flow, "
      "pad.channels, pad.height, "
      "pad.rgb or pad.rgb_marker, a camera's eye.rgb, eye.depth or eye.ids, with times as in "
      "pad/10 or pad/final. q alone takes none. [default: the scene's <outputs>, else all fields]");
  add_whole_number<int>(app, "--repeat", o.repeat, 1, kMostPasses,
                        "Timed passes for each thread count [default: 3]");
  add_seed_option(app, o.seed);
  o.solver.add(app);
  add_flag(app, "--error", o.error,
           "For a scene: print how far its setting is off a reference, in up to 32 environments; "
           "takes many times as long as the timed passes; not with --sleep");
  add_text(app, "--svg", o.svg, "F.svg",
           "Write a picture of speed against threads, with the ideal line");
  add_text(app, "--csv", o.csv, "F.csv", "Write a table, one row per thread count");
  add_overwrite_option(app, o.overwrite, "Replace the outputs if they exist");
  add_allow_unknown_option(app, o.allow_unknown);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return bench(*options, *console); }};
}

}  // namespace tangere::apps
