// SPDX-License-Identifier: Apache-2.0
// What all commands that run a scene share: reading it and its controls, its length, and reports of
// failures.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "engine/base/precision.hpp"
#include "engine/rows/episode_sink.hpp"
#include "engine/rows/run_facts.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere::apps {

/// Throws InputError for an unknown --precision.
Precision precision_named(const std::string& name);

/// The schemes that can be chosen, and one of them by name. Throws InputError for an unknown name.
std::vector<std::string> integrator_names();
Integrator integrator_named(const std::string& name);

/// Throws InputError for an unknown loss.
LossKind loss_named(const std::string& name);

/// Numbers of steps by status: split, accuracy_not_met, tunnelled, damped, overlapping; "" if all
/// are zero.
std::string split_text(const StepCounts& counts);
/// The same five numbers, as "split_steps", "accuracy_not_met_steps", "tunnelled_steps",
/// "damped_steps" and
/// "overlapping_steps".
Json split_json(const StepCounts& counts);

/// Steps of all episodes of a data set, as "simulation_steps", "tunnelled_steps" and
/// "overlapping_steps"; null where a file does not store them. The text is empty if none of the
/// last two is stored or more than 0; else it begins with a comma.
Json steps_json(const std::optional<EpisodeSteps>& steps);
std::string missed_text(const std::optional<EpisodeSteps>& steps);

/// Mean number of sleeping bodies over all steps of environments; empty if sleep is disabled. The
/// text ends in a line break.
std::string sleep_text(double sleep, int moving_bodies, const StepCounts& counts);
/// The same mean; null if no body may sleep. `sleep`: Stepper::sleep().
Json mean_asleep(double sleep, const StepCounts& counts);

/// Reads a scene; its warnings go to the console. `requested`: as in apply_solver_options().
Scene read_scene_for(const std::string& path, bool allow_unknown, const Console& console,
                     const SolverOptions& requested = {});

/// Applies solver options of the command line: accuracy in place of the scene's; tolerance and
/// sleep if the scene has none.
void apply_solver_options(SolverOptions& scene_options, const SolverOptions& requested);

/// The controls of the table at `path`, or the scene's own if `path` is empty.
ControlProgram make_controls(const std::string& path, std::uint64_t seed, const Model& model,
                             const Stepper& stepper, const Console& console);

/// --steps, or the number of steps that the controls last. Throws InputError if neither is given.
std::int64_t step_count(const std::optional<std::int64_t>& requested,
                        const ControlProgram& controls);

/// Warns of meshes whose grids are too coarse, and of bodies that overlap deeply or are too far
/// from the origin at the start.
void warn_about_geometry(const Console& console, const Model& model);
/// Warns of contacts whose impacts are too short for the steps and, with an accuracy, of laws whose
/// errors the estimate does not include.
void warn_about_steps(const Console& console, const Model& model, const Stepper& stepper);
/// Prints a warning on stderr if steps were costly, and returns it; null if not, or with an
/// accuracy.
Json note_costly_steps(const Console& console, Integrator integrator, double accuracy,
                       const StepCounts& counts);

/// Returns the exit code of a run: kSomeFailed if environments failed, or if steps are tunnelled or
/// overlapping, whose counts it prints on stderr.
ExitCode exit_code(const Console& console, bool failed, const StepCounts& counts);

/// Members of the JSON object of a command that writes a file: "seed", the solver's settings,
/// "precision" and "instruction_set".
Json settings_json(const RunFacts& facts);

/// Prints notes on sensors that are not read after every step.
void note_empty_sensors(const Console& console, const Model& model, const RolloutOptions& rollout);

/// Reports that a signal ended the run, when ("after 3 of 9 steps"), and what is left. Returns the
/// exit code. The JSON object includes `result`.
int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when, const std::string& left, const Json& result);
/// Does the same if nothing is left.
int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when);

/// An environment or episode for which no solution was found.
struct Failure {
  std::int64_t number = 0;
  std::int64_t step = 0;
  StepStatus status = StepStatus::not_converged;
};

/// Prints a line for each of the first failures, and how many more there are. `what` is
/// "environment" or "episode". `where` says where all failures are listed.
void list_failures(const Console& console, const std::string& what,
                   const std::vector<Failure>& failures, const std::string& where);
/// Lists all failures. `what` is the key of the number.
Json failures_json(const std::string& what, const std::vector<Failure>& failures);

}  // namespace tangere::apps
