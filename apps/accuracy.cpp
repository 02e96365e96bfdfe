// SPDX-License-Identifier: Apache-2.0
// tangere accuracy: what accuracy costs in time, for a scene or a task, and which setting is the
// cheapest for the accuracy that is needed.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "apps/accuracy_report.hpp"
#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/machine.hpp"
#include "apps/memory.hpp"
#include "apps/named_value.hpp"
#include "apps/pitch_report.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "apps/task_run.hpp"
#include "apps/text_output.hpp"
#include "kernels/numbers/block.hpp"
#include "kernels/table/isa.hpp"
#include "tasks/run/episode_program.hpp"

namespace tangere::apps {
namespace {

constexpr int kComparedEnvironments = 64;  // the fewest full blocks that bound 95 % of all
constexpr int kMoreEnvironments = 2;       // factor for the confirmation run
constexpr std::uint64_t kOtherSeed = 0x5ec0'11d1'00c0'0000;

struct AccuracyArguments {
  std::string scene, quantity, controls, policy, svg, csv;
  std::optional<double> target, tolerance;
  std::optional<std::int64_t> steps;
  std::optional<int> environments, threads;
  std::optional<std::uint64_t> seed;
  bool overwrite = false, allow_unknown = false;
};

int environments_of(const AccuracyArguments& o) {
  return o.environments.value_or(kComparedEnvironments);
}

/// The quantity as given. The default is tactile if there is a sensor, else the state.
AccuracyQuantity quantity_named(const std::string& name, const Model& model) {
  if (name.empty())
    return model.sensors().empty() ? AccuracyQuantity::state : AccuracyQuantity::tactile;
  return named_value(
      "quantity", name,
      {AccuracyQuantity::tactile, AccuracyQuantity::state, AccuracyQuantity::gradient});
}

void check_arguments(const AccuracyArguments& o) {
  check_outputs(o.svg, o.csv);
  if (o.target.value_or(0.5) >= 1)
    throw InputError(
        fmt::format("--target {:g}; expected a share below 1: 0.01 is one percent", *o.target));
}

/// Refuses states and controls that would not fit.
void check_size(const AccuracyArguments& o, const Model& model, std::int64_t steps) {
  const int environments = environments_of(o);
  const double environment_bytes = 3.0 * static_cast<double>(model.state_bytes_per_environment()) +
                                   static_cast<double>(steps) * model.nu() * sizeof(double);
  check_memory(environment_bytes * environments,
               fmt::format("--envs {} of {} steps", environments, steps));
}

/// Makes the episodes of so many environments with a seed; none when a signal came.
using MakeEpisodes =
    std::function<std::optional<FixedEpisodes>(int, std::uint64_t, const std::stop_token&)>;

/// Ends with the report of a sweep.
int report_sweep(const AccuracySubject& subject, const Console& console, const Model& model,
                 const AccuracyReport& report, int signal, TextOutput& svg, TextOutput& csv) {
  console.print(pitch_table(report.pitches, model) + order_text(report, model) + "\n" +
                advice_text(subject, report, model));
  if (svg.requested() && can_draw(report))
    svg.write(accuracy_svg(subject, report), console);
  else if (svg.requested())
    console.note("no picture: no setting has both an error and a cost");
  if (csv.requested()) csv.write(accuracy_csv(subject, report), console);
  int code = exit_code(console, !report.resolved || report.advice < 0, report.reference.counts);
  if (report.stopped) code = signal == SIGINT ? kInterrupted : kTerminated;
  Json result = accuracy_json(subject, report, model);
  result["exit_code"] = code;
  console.result(result);
  return code;
}

int run_sweep(const AccuracyArguments& o, const Console& console, const Model& model,
              const std::string& name, const MakeEpisodes& make) {
  AccuracyOptions options;
  options.quantity = quantity_named(o.quantity, model);
  options.target = o.target.value_or(options.target);
  options.tolerance = o.tolerance;
  const int blocks = (environments_of(o) + kernels::kBlock - 1) / kernels::kBlock;
  options.threads = std::min(o.threads.value_or(processor_count()), blocks);
  const StopSignals signals;
  TextOutput svg(o.svg, o.overwrite), csv(o.csv, o.overwrite);
  AccuracyListener listener;
  listener.stop = signals.token();
  const std::uint64_t seed = o.seed.value_or(0);
  const std::optional<FixedEpisodes> episodes = make(environments_of(o), seed, listener.stop);
  if (!episodes)
    return report_stop(console, "accuracy", signals.received(), "in the first episode");
  const double bytes = accuracy_bytes(*episodes, options.quantity, options.threads);
  check_memory(bytes, fmt::format("--envs {}", environments_of(o)));
  const AccuracySubject subject{o.scene,
                                name,
                                processor_name(),
                                kernels::active_isa_name(),
                                environments_of(o),
                                episodes->samples * episodes->interval(),
                                options.quantity,
                                options.target};
  console.print(accuracy_heading(subject, *episodes));
  listener.reference = [&](const AccuracyReference& r) {
    console.print(reference_row(r, environments_of(o)));
  };
  bool head = false;
  listener.setting = [&](std::span<const AccuracyPoint> points) {
    if (!head) console.print(accuracy_head());
    head = true;
    console.print(accuracy_row(points));
  };
  const int more = std::min(kMoreEnvironments * environments_of(o), kMostEnvironments);
  listener.before_confirmation = [&] {
    console.print(fmt::format("\nwith {} more environments, settings that may be cheaper:", more));
  };
  FreshEpisodes fresh;
  if ((1 + kMoreEnvironments) * bytes < available_memory())
    fresh = [&] { return make(more, seed ^ kOtherSeed, listener.stop); };
  else
    console.note(
        fmt::format("no second comparison: memory does not suffice for {} environments", more));
  const AccuracyReport report = accuracy_sweep(*episodes, options, listener, fresh);
  if (report.stopped && report.points.empty())
    return report_stop(console, "accuracy", signals.received(), "before the first setting");
  return report_sweep(subject, console, model, report, signals.received(), svg, csv);
}

int accuracy_of_task(const AccuracyArguments& o, const Console& console, const Task& task) {
  refuse_with_task(task, {{"--steps", o.steps.has_value()}, {"--allow-unknown", o.allow_unknown}});
  const PolicyKind kind = policy_named(o.policy, o.controls, PolicyKind::scripted);
  const Policy policy = make_policy(task, kind, o.controls);
  check_size(o, task.model(), TaskProgram::steps(task.spec()));
  if (task.spec().restarts && task.spec().warm_up)
    console.note(
        "every action of this task restarts: an episode is its opening, without the policy");
  else
    console.note("controls are those that the policy asks for at the scene's own scheme and step");
  const int every = std::min(sample_interval(task.model()), task.spec().steps_per_action);
  return run_sweep(o, console, task.model(), "task " + task.spec().name,
                   [&](int environments, std::uint64_t seed, const std::stop_token& stop) {
                     return task_episodes(Batch(task.model(), environments, seed), task, policy,
                                          every, stop);
                   });
}

int accuracy(const AccuracyArguments& o, const Console& console) {
  check_arguments(o);
  if (const std::unique_ptr<Task> task = find_task(o.scene, console))
    return accuracy_of_task(o, console, *task);
  refuse_with_scene(o.scene, {{"--policy", !o.policy.empty()}});
  const Model model(read_scene_for(o.scene, o.allow_unknown, console));
  const ControlProgram controls =
      make_controls(o.controls, o.seed.value_or(0), model, Stepper(model), console);
  const std::int64_t steps = step_count(o.steps, controls);
  check_size(o, model, steps);
  const auto make = [&](int environments, std::uint64_t seed, const std::stop_token&) {
    // A table has no random numbers.
    const ControlProgram own =
        o.controls.empty() ? ControlProgram(model, controls.timestep(), seed) : controls;
    return scene_episodes(Batch(model, environments, seed), own, steps, sample_interval(model));
  };
  return run_sweep(o, console, model, model.scene().name, make);
}

}  // namespace

Command add_accuracy(CLI::App& program) {
  const auto options = std::make_shared<AccuracyArguments>();
  const auto console = std::make_shared<Console>();
  AccuracyArguments& o = *options;
  CLI::App& app = add_command(
      program, "accuracy", "Show what accuracy costs in time, and name the cheapest setting",
      "tangere accuracy scenes/rolling_ball_small.xml --target 1e-2 --svg cost.svg");
  add_text(app, "SCENE", o.scene, "", "Scene file (XML), or the name of a task").required();
  add_text(app, "--quantity", o.quantity, "NAME",
           "What is compared: tactile (fields of all sensors, over their norm), state "
           "(coordinates, over their ranges) or gradient (derivatives of the summed squares of all "
           "fields by the controls) [default: tactile, or state without a sensor]");
  add_positive_number(app, "--target", o.target,
                      "Relative error that is good enough [default: 0.01]");
  add_envs_option(app, o.environments,
                  "Environments, each with its own random numbers. Fewer than 59 cannot tell what "
                  "95 % of all others do; then the worst of them counts. [default: 64]");
  add_steps_option(app, o.steps,
                   "For a scene: length in its own steps [default: as many as the controls last]");
  add_controls_option(app, o.controls);
  add_policy_option(app, o.policy);
  add_positive_number(app, "--tol", o.tolerance,
                      "Tolerance of every setting [default: the one that follows scheme and step]");
  add_threads_option(app, o.threads,
                     "Threads [default: the processors here, at most one for 16 environments]");
  add_seed_option(app, o.seed);
  add_text(app, "--svg", o.svg, "F.svg", "Write a picture of cost against error");
  add_text(app, "--csv", o.csv, "F.csv", "Write a table of all figures");
  add_overwrite_option(app, o.overwrite, "Replace the outputs if they exist");
  add_allow_unknown_option(app, o.allow_unknown);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return accuracy(*options, *console); }};
}

}  // namespace tangere::apps
