// SPDX-License-Identifier: Apache-2.0
// tangere bench: how fast a scene runs here, by threads. Everything is checked before the first step.
#include <fmt/format.h>

#include <algorithm>

#include "apps/arguments.hpp"
#include "apps/bench_report.hpp"
#include "apps/command.hpp"
#include "apps/machine.hpp"
#include "apps/memory.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "io/nearest_name.hpp"
#include "io/part_file.hpp"
#include "kernels/isa.hpp"
#include "kernels/lanes.hpp"

namespace tangere::apps {
namespace {

constexpr int kMostThreads = 1024;
constexpr int kMostPasses = 1'000'000;
constexpr int kDefaultEnvironments = 256;  // 16 blocks: a few for each thread of a usual machine

struct Options {
  std::string scene, frames = "dense", precision = "mixed", svg, csv;
  std::vector<int> threads;
  std::optional<std::int64_t> steps;
  std::optional<int> environments, every, repeat;
  std::optional<std::uint64_t> seed;
  bool overwrite = false, allow_unknown = false;
};

FrameKind frames_named(const std::string& name) {
  std::vector<std::string> names;
  for (const FrameKind value : {FrameKind::dense, FrameKind::compact, FrameKind::none}) {
    names.emplace_back(to_string(value));
    if (names.back() == name) return value;
  }
  throw InputError("unknown frames '" + name + "'" + suggestion(name, names));
}

void check_arguments(const Options& options) {
  for (const std::string& output : {options.svg, options.csv})
    if (!output.empty()) check_not_same_file(output, options.scene);
  if (!options.svg.empty() && options.svg == options.csv)
    throw InputError(fmt::format("--svg and --csv are both '{}'; expected two files", options.svg));
}

void check_size(const Model& model, const BenchSetting& setting, int most_threads) {
  BenchmarkOptions options = setting.options;
  options.threads = most_threads;
  const double start =
      static_cast<double>(model.state_bytes_per_environment()) * setting.environments;
  check_memory(start + benchmark_bytes(model, setting.environments, options),
               fmt::format("--envs {}", setting.environments));
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

/// The files asked for, reserved before the first step, complete or absent at the end.
class Outputs {
 public:
  explicit Outputs(const Options& options) {
    if (!options.svg.empty()) svg_.emplace(options.svg, options.overwrite);
    if (!options.csv.empty()) csv_.emplace(options.csv, options.overwrite);
  }

  void write(const BenchSetting& setting, const std::vector<BenchRun>& runs, const Json& entries,
             const Console& console) {
    if (svg_) write(*svg_, bench_svg(setting, runs), console);
    if (csv_) write(*csv_, bench_csv(setting, entries), console);
  }

 private:
  static void write(PartFile& file, const std::string& text, const Console& console) {
    file.write(text);
    file.commit();
    console.print(fmt::format("wrote {} ({} bytes)", file.output(), text.size()));
  }

  std::optional<PartFile> svg_, csv_;
};

void tell_passes(const Console& console, const BenchRun& run) {
  for (const BenchmarkTime& time : run.result.times)
    console.detail(fmt::format("threads {}: {:.4f} s, CPU {:.4f} s", run.threads, time.seconds,
                               time.cpu_seconds));
}

int report(const Options& options, const Console& console, const BenchSetting& setting,
           const Batch& start, const ControlProgram& controls, const Json& entries) {
  const bool any_failed = !entries.at(0).at("failed").empty();
  const ExitCode code = any_failed ? kSomeFailed : kDone;
  console.result({{"command", "bench"},
                  {"exit_code", static_cast<int>(code)},
                  {"scene", options.scene},
                  {"machine", setting.machine},
                  {"seed", start.seed()},
                  {"timestep", controls.timestep()},
                  {"integrator", to_string(start.model().integrator())},
                  {"tolerance", start.model().solver().tolerance},
                  {"svg", options.svg.empty() ? Json() : Json(options.svg)},
                  {"csv", options.csv.empty() ? Json() : Json(options.csv)},
                  {"runs", entries}});
  return code;
}

BenchSetting setting_of(const Options& options, const Model& model,
                        const ControlProgram& controls) {
  BenchSetting setting;
  setting.scene = options.scene;
  setting.model = model.scene().name;
  setting.machine = processor_name();
  setting.isa = kernels::active_isa_name();
  setting.options.precision = precision_named(options.precision);
  setting.environments = options.environments.value_or(kDefaultEnvironments);
  setting.options.rollout = {step_count(options.steps, controls), options.every.value_or(0)};
  setting.options.frames = frames_named(options.frames);
  setting.options.repeat = options.repeat.value_or(setting.options.repeat);
  setting.every = common_interval(model, setting.options.rollout);
  return setting;
}

int bench(const Options& options, const Console& console) {
  check_arguments(options);
  // A wrong word is said before a scene is read.
  frames_named(options.frames);
  precision_named(options.precision);
  const Model model(read_scene_for(options.scene, options.allow_unknown, console));
  const std::uint64_t seed = options.seed.value_or(0);
  const ControlProgram controls(model, model.timestep(), seed);
  if (!model.scene().control && model.nu() > 0)
    console.note("the scene has no <control>: every control is 0");
  BenchSetting setting = setting_of(options, model, controls);
  const std::vector<int> threads =
      options.threads.empty() ? default_thread_counts() : options.threads;
  const int most_threads = *std::max_element(threads.begin(), threads.end());
  if (setting.options.frames != FrameKind::none)
    note_empty_sensors(console, model, setting.options.rollout);
  note_idle_threads(console, setting.environments, most_threads);
  check_size(model, setting, most_threads);
  const Batch start(model, setting.environments, seed);

  const StopSignals signals;
  Outputs outputs(options);
  console.print(bench_heading(setting));
  std::vector<BenchRun> runs;
  Json entries = Json::array();
  for (const int n : threads) {
    setting.options.threads = n;
    runs.push_back({n, run_benchmark(start, controls, setting.options,
                                     [&] { return signals.received() == 0; })});
    if (runs.back().result.stopped)
      return report_stop(console, "bench", signals.received(),
                         fmt::format("while measuring {} thread{}", n, n == 1 ? "" : "s"));
    entries.push_back(bench_entry(setting, runs.back()));
    console.print(bench_row(runs.back(), runs.front()));
    tell_passes(console, runs.back());
  }
  console.print(bench_footing(runs.front()));
  list_failures(console, "environment", failures_of(runs.front()), "--json names all");
  outputs.write(setting, runs, entries, console);
  return report(options, console, setting, start, controls, entries);
}

}  // namespace

Command add_bench(CLI::App& program) {
  const auto options = std::make_shared<Options>();
  const auto console = std::make_shared<Console>();
  Options& o = *options;
  CLI::App* app = program.add_subcommand("bench", "Measure how fast a scene runs, by threads");
  add_text(*app, "SCENE", o.scene, "", "Scene file (XML)")->required();
  add_whole_number<int>(*app, "--envs", o.environments, 1, kMostEnvironments,
                        "Environments, in blocks of 16 [default: 256]");
  add_whole_number<std::int64_t>(*app, "--steps", o.steps, 1, kMostSteps,
                                 "Steps of the episode [default: as many as the controls last]");
  add_whole_numbers(*app, "--threads", o.threads, 1, kMostThreads,
                    "Thread counts to measure [default: 1,2,4,... up to the processors here]");
  add_text(*app, "--precision", o.precision, "NAME",
           "Of tactile fields: double, or mixed, points in float [default: mixed]");
  add_whole_number<int>(*app, "--every", o.every, 1, kMostEnvironments,
                        "Tactile fields every N-th step [default: the scene's, or 1]");
  add_text(*app, "--frames", o.frames, "NAME",
           "Of tactile fields: dense, every point; compact, touched tiles; none [default: dense]");
  add_whole_number<int>(*app, "--repeat", o.repeat, 1, kMostPasses,
                        "Timed passes over the episode; the best counts [default: 3]");
  add_whole_number<std::uint64_t>(*app, "--seed", o.seed, 0, UINT64_MAX,
                                  "Seed of all that varies between environments [default: 0]");
  add_text(*app, "--svg", o.svg, "F.svg", "Picture of speed against threads to write");
  add_text(*app, "--csv", o.csv, "F.csv", "Table of all figures to write");
  app->add_flag("--overwrite", o.overwrite, "Replace the outputs if they exist");
  app->add_flag("--allow-unknown", o.allow_unknown,
                "Unknown elements and attributes of the scene are warnings, not errors");
  add_console_options(*app, *console);
  app->footer(
      "Example:\n"
      "  tangere bench scenes/rolling_ball_small.xml --envs 32 --steps 50 --threads 1,2 --svg "
      "speed.svg");
  return {app, [=](const ProgramInfo&) { return bench(*options, *console); }};
}

}  // namespace tangere::apps
