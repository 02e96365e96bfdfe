// SPDX-License-Identifier: Apache-2.0
// tangere simulate: runs a scene or a task as a batch and writes a file. Everything is checked
// before the first step.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/memory.hpp"
#include "apps/progress.hpp"
#include "apps/record.hpp"
#include "apps/run_gradients.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "apps/task_report.hpp"
#include "apps/task_run.hpp"
#include "io/files/nearest_name.hpp"
#include "io/hdf5/reading_note.hpp"
#include "io/trajectory/saved_state.hpp"
#include "io/trajectory/trajectory_file.hpp"
#include "kernels/table/isa.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/block_worker.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/episodes.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere::apps {
namespace {

struct SimulateArguments {
  std::string scene, output, controls, policy, precision = "double", state_from, record;
  GradientArguments gradients;
  std::optional<std::int64_t> steps, row;
  std::optional<int> environments, every, threads;
  SolverArguments solver;
  std::optional<std::uint64_t> seed;
  bool audit = false, overwrite = false, allow_unknown = false;
};

void check_arguments(const SimulateArguments& options) {
  options.gradients.check();
  if (options.row && options.state_from.empty())
    throw InputError("--row without --state-from; expected both");
}

void check_size(const Model& model, int environments, int threads, const RolloutOptions& rollout) {
  const double state =
      static_cast<double>(model.state_bytes_per_environment() + Stepper::candidate_bytes(model));
  check_memory(state * environments + rollout_bytes(model, environments, rollout.outputs) +
                   threads * static_cast<double>(Stepper::workspace_bytes(model)),
               fmt::format("--envs {}", environments));
}

/// A thread steps whole blocks, so more threads than blocks would be idle.
int threads_of(const SimulateArguments& options, int environments) {
  return std::min(options.threads.value_or(available_threads()),
                  (environments + kernels::kBlock - 1) / kernels::kBlock);
}
/// Adds steppers of the same options to the first one.
std::vector<Stepper> steppers_of(Stepper first, const Model& model, const StepperOptions& solver,
                                 int threads) {
  std::vector<Stepper> steppers;
  steppers.push_back(std::move(first));
  while (std::ssize(steppers) < threads) steppers.emplace_back(model, solver);
  return steppers;
}

RolloutOutputs outputs_of(const SimulateArguments& options, const Model& model) {
  Record record = record_of(options.record, model);
  take_bodies(record, model);
  take_memory(record, model);
  record.outputs.audit = options.audit;
  return record.outputs;
}

/// `task`: null for a scene alone.
RunFacts facts_of(const Batch& batch, const Stepper& stepper, Precision precision,
                  const ProgramInfo& info, const Task* task = nullptr) {
  RunOrigin origin{.precision = to_string(precision),
                   .version = info.version,
                   .instruction_set = kernels::active_isa_name(),
                   .command = info.command_line,
                   .task = {}};
  if (task != nullptr) origin.task = task->spec();
  return run_facts(batch.model(), stepper, origin, batch.seed());
}

std::vector<Failure> failures_of(const RolloutSummary& summary) {
  std::vector<Failure> failures;
  for (const FailedEnvironment& f : summary.failures)
    failures.push_back({f.environment, f.step, f.status});
  return failures;
}

/// What `--audit` adds to the report: a line for people, which ends in a line break, and keys.
std::string audit_text(const std::optional<EnergyBalanceSummary>& audit) {
  if (!audit) return "";
  return fmt::format(
      "audit: motors did {:.4g} J, damping and friction took {:.4g} J, the scheme made {:.4g} J; "
      "at worst {:.2g} % of what environment {} had\n",
      audit->motors, audit->taken, audit->made, 100 * audit->worst_share, audit->worst_environment);
}
Json audit_json(const std::optional<EnergyBalanceSummary>& audit) {
  if (!audit) return nullptr;
  return {{"motors", audit->motors},
          {"taken", audit->taken},
          {"made", audit->made},
          {"worst_share", audit->worst_share},
          {"worst_environment", audit->worst_environment}};
}

Json sensors_json(const Model& model, const RolloutOptions& rollout) {
  Json sensors = Json::array();
  for (const FieldOutput of : fields_of(model, rollout.outputs))
    sensors.push_back({{"name", source_name(model.scene(), of)},
                       {"form", to_string(of.form)},
                       {"every", reading_times(model, of, rollout).every},
                       {"frames", tactile_frames(model, of, rollout)}});
  return sensors;
}

int report(const SimulateArguments& options, const Console& console, const Batch& batch,
           const RunFacts& facts, const RolloutOptions& rollout, const RolloutSummary& summary,
           const TaskReport& task_report) {
  const ExitCode code = exit_code(console, !summary.failures.empty(), summary.counts);
  const auto bytes = std::filesystem::file_size(options.output);
  const std::int64_t environment_steps = summary.counts.simulation_steps;
  const double rate = static_cast<double>(environment_steps) / summary.seconds;
  const double per_step = static_cast<double>(summary.counts.newton_iterations) /
                          static_cast<double>(std::max<std::int64_t>(1, environment_steps));
  list_failures(console, "environment", failures_of(summary), "--json and the file name all");
  console.print(
      fmt::format("environments: {}, steps: {}, time: {:.2f} s, {:.0f} env-steps/s with output\n"
                  "Newton iterations per step: {:.2f}, {}, environments failed: {}\n{}{}{}\n"
                  "wrote {} ({} bytes)",
                  batch.environments(), summary.steps, summary.seconds, rate, per_step,
                  split_text(summary.counts), summary.failures.size(),
                  sleep_text(facts.sleep, batch.model().moving_bodies(), summary.counts),
                  audit_text(summary.audit), task_report.line, options.output, bytes));
  const Json costly = note_costly_steps(console, integrator_named(facts.integrator), facts.accuracy,
                                        summary.counts);
  Json result{{"command", "simulate"},
              {"exit_code", static_cast<int>(code)},
              {"scene", options.scene},
              {"output", options.output},
              {"bytes", bytes},
              {"steps", summary.steps},
              {"first_step", rollout.first_step},
              {"state_from", options.state_from.empty() ? Json() : Json(options.state_from)},
              {"environments", batch.environments()}};
  result.update(settings_json(facts));
  result.update({{"sensors", sensors_json(batch.model(), rollout)},
                 {"seconds", summary.seconds},
                 {"environment_steps", environment_steps},
                 {"environment_steps_per_second", rate},
                 {"newton_iterations", summary.counts.newton_iterations},
                 {"newton_iterations_per_step", per_step}});
  result.update(split_json(summary.counts));
  result["loads_not_carried"] = summary.counts.loads_not_carried;
  result.update({{"mean_asleep", mean_asleep(facts.sleep, summary.counts)},
                 {"costly", costly},
                 {"audit", audit_json(summary.audit)},
                 {"failed", failures_json("environment", failures_of(summary))}});
  result.update(task_report.keys);
  console.result(result);
  return code;
}

/// Rows of a file with shear state, for a message: " (row 60 does)".
std::string rows_with_memory(const SavedState& saved) {
  constexpr std::size_t kListed = 5;
  const std::vector<std::int64_t>& rows = saved.memory_rows;
  if (rows.empty()) return "";
  const bool one = rows.size() == 1;
  return fmt::format(" (row{} {}{} do{})", one ? "" : "s",
                     fmt::join(std::span(rows).first(std::min(rows.size(), kListed)), ", "),
                     rows.size() > kListed ? " …" : "", one ? "es" : "");
}

/// The start of the run: the scene's own, or a row of another run.
struct Start {
  std::optional<SavedState> saved;
  std::uint64_t seed = 0;
  int environments = 1;
  std::int64_t first_step = 0;
  bool continues = false;  ///< steps like the run before: same step size, with its history

  Start(const SimulateArguments& options, const Stepper& stepper) {
    if (!options.state_from.empty()) saved = read_state(options.state_from, options.row);
    seed = options.seed.value_or(saved ? saved->seed : 0);
    environments = options.environments.value_or(saved ? saved->environments : 1);
    continues = saved && saved->timestep == stepper.timestep() &&
                saved->integrator == to_string(stepper.integrator());
    if (continues) first_step = saved->step;
  }

  void print(const Console& console, const Model& model, const Scene& scene,
             const Stepper& stepper) const {
    if (!saved) return;
    if (model.has_shear_state() && !saved->memory)
      console.note(
          fmt::format("row {} of {} does not hold the shear state{}: contacts with ks and joints "
                      "with friction begin unsheared; "
                      "simulate stores it at its last row, and with --record memory at every row",
                      saved->row, saved->path, rows_with_memory(*saved)));
    if (!continues)
      console.note(
          fmt::format("{} was made by {} with steps of {} s, this run takes {} with {} s: it "
                      "starts anew at time 0 "
                      "from that state",
                      saved->path, saved->integrator, saved->timestep,
                      to_string(stepper.integrator()), stepper.timestep()));
    else if (saved->tolerance != stepper.tolerance())
      console.note(
          fmt::format("{} was solved to {:g}, this run is solved to {:g}: it goes on, but not with "
                      "the bits of one long run; --tol sets the tolerance",
                      saved->path, saved->tolerance, stepper.tolerance()));
    else if (saved->accuracy != stepper.accuracy())
      console.note(fmt::format(
          "{} was made with accuracy {:g}, this run has {:g} (0: steps are not cut): it goes on, "
          "but not with the bits of one long run; --accuracy sets it",
          saved->path, saved->accuracy, stepper.accuracy()));
    else if (saved->sleep != stepper.sleep())
      console.note(fmt::format(
          "{} was made with sleep {:g}, this run has {:g} (0: no body sleeps): it goes on, but not "
          "with the bits of one long run",
          saved->path, saved->sleep, stepper.sleep()));
    else if (saved->sleep > 0 && !saved->sleep_state)
      console.note(
          fmt::format("{} does not hold which bodies slept: the run goes on with all of "
                      "them awake, and not with the bits of one long run",
                      saved->path));
    else if (saved->previous_q.empty() && saved->step > 0)
      console.note(
          fmt::format("row {} of {} has no row before it: a scheme of two steps starts anew there",
                      saved->row, saved->path));
    if (saved->scene_text != scene.text)
      console.note(fmt::format("the scene is not the one that {} was made with", saved->path));
    if (saved->seed != seed)
      console.note(
          fmt::format("{} was made with seed {}: what varies between environments is another draw",
                      saved->path, saved->seed));
  }
};

/// --steps, or the number of steps that the controls last after the start.
std::int64_t steps_left(const SimulateArguments& options, const ControlProgram& controls,
                        std::int64_t first_step) {
  if (options.steps) return *options.steps;
  const std::int64_t left = step_count({}, controls) - first_step;
  if (left < 1)
    throw InputError(
        fmt::format("the controls end at step {}, the run starts at step {}; give --steps",
                    controls.steps(), first_step));
  return left;
}

/// Steps and writes. `run`: the rollout into the file; it receives a progress function.
template <class Run>
int write_run(const SimulateArguments& options, const Console& console, const Batch& batch,
              const RunFacts& facts, const RolloutOptions& rollout, TrajectoryFile& output,
              const StopSignals& signals, const Run& run,
              const std::function<TaskReport()>& task_report) {
  console.detail(fmt::format("environments: {}, steps: {}, {}, h = {} s", batch.environments(),
                             rollout.steps, facts.integrator, facts.timestep));
  RolloutSummary summary;
  {
    const h5::NotReading computing;
    Progress progress(console, "step", rollout.steps, batch.environments());
    summary = run([&](std::int64_t done) { progress.update(done); });
  }
  if (summary.stopped)
    return report_stop(console, "simulate", signals.received(),
                       fmt::format("after {} of {} steps", summary.steps, rollout.steps));
  output.commit();
  return report(options, console, batch, facts, rollout, summary, task_report());
}

int simulate_task(const SimulateArguments& options, const Console& console, const ProgramInfo& info,
                  const Task& task, Precision precision) {
  refuse_with_task(task, {{"--gradients", options.gradients.requested()},
                          {"--steps", options.steps.has_value()},
                          {"--state-from", !options.state_from.empty()},
                          {"--timestep", options.solver.timestep.has_value()},
                          {"--integrator", !options.solver.integrator.empty()},
                          {"--tol", options.solver.tolerance.has_value()}});
  const PolicyKind kind = policy_named(options.policy, options.controls, PolicyKind::scripted);
  const Policy policy = make_policy(task, kind, options.controls);
  const Model& model = task.model();
  const int environments = options.environments.value_or(1),
            threads = threads_of(options, environments);
  const RolloutOptions rollout{TaskProgram::steps(task.spec()), options.every.value_or(0),
                               precision, 0, outputs_of(options, model)};
  note_empty_sensors(console, model, rollout);
  check_size(model, environments, threads, rollout);
  std::vector<Stepper> steppers = steppers_of(Stepper(model), model, {}, threads);
  Batch batch(model, environments, options.seed.value_or(0));
  const auto data = std::make_shared<EnvironmentData>(task, batch.environments());
  data->restart(batch);
  TaskProgram program(task, policy, data, precision, batch.blocks());
  for (int b = 0; b < batch.blocks(); ++b) program.start(batch, b);

  const StopSignals signals;
  const RunFacts facts = facts_of(batch, steppers.front(), precision, info, &task);
  Recording recording = rollout_recording(batch, steppers.front(), rollout, facts);
  recording.facts.push_back({"policy", to_string(kind)});
  TrajectoryFile output(options.output, recording, options.overwrite);
  return write_run(
      options, console, batch, facts, rollout, output, signals,
      [&](const ProgressCallback& progress) {
        return run_rollout(batch, steppers, program, rollout, output, progress, signals.token());
      },
      [&] {
        const auto solved = std::count(data->success.begin(), data->success.end(), 1);
        const double mean =
            std::accumulate(data->returns.begin(), data->returns.end(), 0.0) / batch.environments();
        return report_of(task, kind, to_string(kind), {batch.environments(), solved, mean});
      });
}

int simulate(const SimulateArguments& options, const Console& console, const ProgramInfo& info) {
  check_arguments(options);
  const Precision precision = precision_named(options.precision);
  if (const std::unique_ptr<Task> task =
          find_task(options.scene, console, options.solver.requested()))
    return simulate_task(options, console, info, *task, precision);
  refuse_with_scene(options.scene, {{"--policy", !options.policy.empty()}});
  StepperOptions solver{
      .integrator = {}, .timestep = options.solver.timestep, .tolerance = options.solver.tolerance};
  if (!options.solver.integrator.empty())
    solver.integrator = integrator_named(options.solver.integrator);

  const Model model(
      read_scene_for(options.scene, options.allow_unknown, console, options.solver.requested()));
  warn_about_geometry(console, model);
  solver.differentiable = options.gradients.requested();
  Stepper stepper(model, solver);
  warn_about_steps(console, model, stepper);
  const Start start(options, stepper);
  start.print(console, model, model.scene(), stepper);
  const ControlProgram controls =
      make_controls(options.controls, start.seed, model, stepper, console);
  const RolloutOptions rollout{steps_left(options, controls, start.first_step),
                               options.every.value_or(0), precision, start.first_step,
                               outputs_of(options, model)};
  controls.check_covers(rollout.first_step + rollout.steps);
  note_empty_sensors(console, model, rollout);
  const int threads = threads_of(options, start.environments);
  check_size(model, start.environments, threads, rollout);
  std::vector<Stepper> steppers = steppers_of(std::move(stepper), model, solver, threads);
  Batch batch(model, start.environments, start.seed, start.saved ? start.saved->first_episode : 0);
  if (start.saved) restore_state(*start.saved, start.continues, batch);
  RunGradients gradients(options.gradients, batch, steppers.front(), rollout);

  // Exists from before the file is created until it is complete or removed, so that no incomplete
  // file remains.
  const StopSignals signals;
  const RunFacts facts = facts_of(batch, steppers.front(), precision, info);
  TrajectoryFile output(options.output, rollout_recording(batch, steppers.front(), rollout, facts),
                        options.overwrite);
  return write_run(
      options, console, batch, facts, rollout, output, signals,
      [&](const ProgressCallback& progress) {
        RolloutSummary summary =
            run_rollout(batch, steppers, controls, rollout, output, progress, signals.token());
        if (gradients.requested() && !summary.stopped)
          summary.stopped = !gradients.write(controls, rollout, signals, output);
        return summary;
      },
      [&] {
        TaskReport run_report;
        run_report.keys["gradients"] = gradients.json();
        return run_report;
      });
}

}  // namespace

Command add_simulate(CLI::App& program) {
  const auto options = std::make_shared<SimulateArguments>();
  const auto console = std::make_shared<Console>();
  SimulateArguments& o = *options;
  CLI::App& app = add_command(
      program, "simulate", "Run a scene or a task and write its trajectory",
      "tangere simulate scenes/rolling_ball.xml --output ball.h5 --envs 4 --every 5 --seed 1");
  add_text(app, "SCENE", o.scene, "", "Scene file (XML), or the name of a task").required();
  add_text(app, "-o,--output", o.output, "F.h5", "HDF5 file to write").required();
  add_controls_option(app, o.controls);
  add_policy_option(app, o.policy);
  add_steps_option(app, o.steps, "Steps to take [default: as many as the controls last]");
  add_envs_option(app, o.environments,
                  "Environments. Environment e draws what varies from (seed, e). [default: 1, or "
                  "those of --state-from]");
  add_text(
      app, "--record", o.record, "LIST",
      "What to compute and store besides q, v, u and the solver's numbers, separated by "
      "commas: bodies or bodies.NAME, variables, memory (of friction), transmissions (their "
      "forces), a sensor's field "
      "(pad), pad.pressure, pad.shear, pad.sum, pad.ideal, pad.markers, pad.surface, pad.flow, "
      "pad.channels, pad.height, pad.rgb or pad.rgb_marker, a camera's eye.rgb, eye.depth or "
      "eye.ids; "
      "pad/10 is every 10th step, q/final the end alone [default: the scene's <outputs>, else "
      "bodies, "
      "variables and all fields]");
  add_flag(app, "--audit", o.audit,
           "Also compute and store energy and momentum, the work of motors, what damping and "
           "friction took, and what the scheme made");
  add_every_option(app, o.every);
  add_text(app, "--state-from", o.state_from, "F.h5",
           "Start from a row of another run, environment e from its e");
  add_whole_number<std::int64_t>(app, "--row", o.row, 0, kMostSteps,
                                 "Row of --state-from, counted from 0 [default: the last]");
  o.solver.add(app);
  o.gradients.add(app);
  add_threads_option(
      app, o.threads,
      "Threads to run on; numbers are the same for any count [default: one per core]");
  add_precision_option(app, o.precision, " (points in float) [default: double]");
  add_seed_option(
      app, o.seed,
      "Seed of all that varies between environments [default: 0, or that of --state-from]");
  add_overwrite_option(app, o.overwrite);
  add_allow_unknown_option(app, o.allow_unknown);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo& info) { return simulate(*options, *console, info); },
          [=] { return !options->state_from.empty(); }};
}

}  // namespace tangere::apps
