// SPDX-License-Identifier: Apache-2.0
// What every subcommand that steps a scene asks before it and says after it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "engine/control.hpp"
#include "tasks/rollout.hpp"

namespace tangere::apps {

/// Largest --envs and --steps: beyond any machine, and safe to multiply.
constexpr int kMostEnvironments = 1'000'000'000;
constexpr std::int64_t kMostSteps = 1'000'000'000'000;

/// Steps to take: as asked, or as many as the controls last. Throws InputError when the controls
/// have no end or too few rows.
std::int64_t step_count(std::optional<std::int64_t> asked, const ControlProgram& controls);

/// Remarks on sensors that are read less often than there are steps.
void note_empty_sensors(const Console& console, const Model& model, const RolloutOptions& rollout);

/// Says that a signal ended the run and when ("after 3 of 9 steps"); returns its exit code.
int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when);

/// List of `environment`, `step`, `status`, `reason`.
Json failures_of(const std::vector<FailedEnvironment>& failures);

/// The first of them on stderr, and how many more there are; `where`: what names all.
void list_failures(const Console& console, const std::vector<FailedEnvironment>& failures,
                   const std::string& where);

}  // namespace tangere::apps
