// SPDX-License-Identifier: Apache-2.0
// What every command that runs a scene does the same way: reading it, its controls, how long it
// lasts, and telling what failed.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "engine/base/precision.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere::apps {

/// Largest --envs and --steps: beyond any machine, and safe to multiply.
constexpr int kMostEnvironments = 1'000'000'000;
constexpr std::int64_t kMostSteps = 1'000'000'000'000;

/// Throws InputError for a --precision that there is not.
Precision precision_named(const std::string& name);

/// Throws InputError for a loss that there is not.
LossKind loss_named(const std::string& name);

/// Reads a scene; its warnings go to the console.
Scene read_scene_for(const std::string& path, bool allow_unknown, const Console& console);

/// The controls of the table at `path`, or the scene's own where that is empty.
ControlProgram make_controls(const std::string& path, std::uint64_t seed, const Model& model,
                             const Stepper& stepper, const Console& console);

/// --steps, or as many as the controls last. Throws InputError when neither says.
std::int64_t step_count(const std::optional<std::int64_t>& asked, const ControlProgram& controls);

/// Remarks on sensors that are read less often than there are steps.
void note_empty_sensors(const Console& console, const Model& model, const RolloutOptions& rollout);

/// Says that a signal ended the run, when ("after 3 of 9 steps") and what is left of it; returns
/// its exit code. `result` comes along in the JSON object.
int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when, const std::string& left, const Json& result);
/// Where nothing is left.
int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when);

/// What no solution was found for: an environment, an episode.
struct Failure {
  std::int64_t number = 0;
  std::int64_t step = 0;
  StepStatus status = StepStatus::not_converged;
};

/// A line for each of the first failures, and how many more there are; `what`: "environment",
/// "episode"; `where`: what names all.
void list_failures(const Console& console, const std::string& what,
                   const std::vector<Failure>& failures, const std::string& where);
/// All of them; `what` is the key of the number.
Json failures_json(const std::string& what, const std::vector<Failure>& failures);

}  // namespace tangere::apps
