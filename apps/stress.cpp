// SPDX-License-Identifier: Apache-2.0
// tangere stress: what happens on this machine in cases that are hard to simulate.
#include <fmt/format.h>

#include <csignal>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/machine.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "apps/stress_report.hpp"
#include "apps/task_run.hpp"
#include "io/files/nearest_name.hpp"
#include "io/scene/scene_reader.hpp"
#include "kernels/table/isa.hpp"

namespace tangere::apps {
namespace {

struct StressArguments {
  std::string name, integrator;
  std::optional<double> step, accuracy;
  std::optional<int> threads;
  bool quick = false;
};

StressOptions options_of(const StressArguments& o) {
  StressOptions options;
  options.name = o.name;
  options.step = o.step;
  options.accuracy = o.accuracy;
  options.quick = o.quick;
  options.threads = o.threads.value_or(processor_count());
  if (!o.integrator.empty()) options.integrator = integrator_named(o.integrator);
  if (o.name.empty()) return options;
  const std::vector<std::string> names = stress_names(stress_cases());
  if (std::find(names.begin(), names.end(), o.name) == names.end())
    throw InputError("unknown case '" + o.name + "'" + suggestion(o.name, names));
  return options;
}

StressScene scene_of_program(const std::string& file) {
  const char* const text = program_scene(file);
  if (text == nullptr) throw IoError("the scene " + file + " is not in the program");
  SceneFile read = parse_scene(text, file);
  return {std::move(read.scene), std::move(read.warnings)};
}

int stress(const StressArguments& o, const Console& console) {
  const StressOptions options = options_of(o);
  const StopSignals signals;
  console.print(fmt::format("hard cases; {}; {}\n\n{}", kernels::active_isa_name(),
                            processor_name(), stress_head()));
  const StressListener listener{signals.token(),
                                [&](const StressRow& row) { console.print(stress_row(row)); }};
  const StressReport report = run_stress(stress_cases(), options, scene_of_program, listener);
  if (report.stopped && report.rows.empty())
    return report_stop(console, "stress", signals.received(), "in the first case");
  console.print("\n" + stress_summary(report));
  int code = silent_failures(report) == 0 ? kDone : kSomeFailed;
  if (report.stopped) code = signals.received() == SIGINT ? kInterrupted : kTerminated;
  Json result{{"command", "stress"},
              {"exit_code", code},
              {"machine", processor_name()},
              {"isa", kernels::active_isa_name()},
              {"accuracy", o.accuracy.value_or(0)},
              {"quick", o.quick}};
  result.update(stress_json(report));
  console.result(result);
  return code;
}

}  // namespace

Command add_stress(CLI::App& program) {
  const auto options = std::make_shared<StressArguments>();
  const auto console = std::make_shared<Console>();
  StressArguments& o = *options;
  CLI::App& app =
      add_command(program, "stress", "Play cases that are hard to simulate, and rate each",
                  "tangere stress --case stack_equal --integrator BDF1");
  add_text(app, "--case", o.name, "NAME", "That case alone [default: all]");
  add_integrator_option(app, o.integrator, "those of each case");
  add_positive_number(app, "--timestep", o.step, "Step size [s] [default: those of each case]");
  add_positive_number(app, "--accuracy", o.accuracy,
                      "Cut steps into parts that keep this relative accuracy, with schemes that "
                      "estimate their error [default: steps are not cut]");
  add_flag(app, "--quick", o.quick,
           "Short cases alone, each with its first step and at most two environments: "
           "seconds in place of minutes");
  add_threads_option(app, o.threads,
                     "Threads. Cases of one environment use one. [default: the processors here]");
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return stress(*options, *console); }};
}

}  // namespace tangere::apps
