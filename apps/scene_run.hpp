// SPDX-License-Identifier: Apache-2.0
// What every command that runs a scene does the same way: reading it, its controls, how long it
// lasts, and telling what failed.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "engine/control.hpp"
#include "engine/stepper.hpp"

namespace tangere::apps {

/// Throws InputError for a --precision that there is not.
void check_precision(const std::string& precision);

/// Reads a scene; its warnings go to the console.
Scene read_scene_for(const std::string& path, bool allow_unknown, const Console& console);

/// The controls of the table at `path`, or the scene's own where that is empty.
ControlProgram make_controls(const std::string& path, std::uint64_t seed, const Model& model,
                             const Stepper& stepper, const Console& console);

/// --steps, or as many as the controls last. Throws InputError when neither says.
std::int64_t step_count(const std::optional<std::int64_t>& asked, const ControlProgram& controls);

/// What no solution was found for: an environment, an episode.
struct Failure {
  std::int64_t number = 0;
  std::int64_t step = 0;
  StepStatus status = StepStatus::not_converged;
};

/// A line for each of the first failures; `what`: "environment", "episode".
void list_failures(const Console& console, const std::string& what,
                   const std::vector<Failure>& failures);
/// All of them; `what` is the key of the number.
Json failures_json(const std::string& what, const std::vector<Failure>& failures);

}  // namespace tangere::apps
