// SPDX-License-Identifier: Apache-2.0
// Options that commands share: one range, one unit and one name each. A command may give a
// description with its default.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "apps/arguments.hpp"
#include "engine/step/stepper.hpp"

namespace tangere::apps {

/// Largest --envs, --every and --steps: beyond any machine, but safe to multiply.
constexpr int kMostEnvironments = 1'000'000'000;
constexpr std::int64_t kMostSteps = 1'000'000'000'000;

void add_steps_option(CLI::App& app, std::optional<std::int64_t>& steps,
                      const std::string& description);
void add_envs_option(CLI::App& app, std::optional<int>& environments,
                     const std::string& description);
void add_every_option(CLI::App& app, std::optional<int>& every,
                      const std::string& description =
                          "Read tactile fields every N steps [default: the scene's, or 1]");
void add_threads_option(CLI::App& app, std::optional<int>& threads,
                        const std::string& description = "Threads [default: the processors here]");
void add_seed_option(
    CLI::App& app, std::optional<std::uint64_t>& seed,
    const std::string& description = "Seed of all that varies between environments [default: 0]");
/// `meaning`: of mixed, and the default.
void add_precision_option(CLI::App& app, std::string& precision, const std::string& meaning);
void add_overwrite_option(CLI::App& app, bool& overwrite,
                          const std::string& description = "Replace the output if it exists");
/// Adds --accuracy, which every command that plays a scene or a task has.
void add_accuracy_option(CLI::App& app, std::optional<double>& accuracy);
/// Adds --sleep, which commands have that step and take no derivatives.
void add_sleep_option(CLI::App& app, bool& sleep);
/// Adds --allow-unknown, which every command that reads a scene has.
void add_allow_unknown_option(CLI::App& app, bool& allow);
/// Adds --controls, a table that drives a scene or a task.
void add_controls_option(CLI::App& app, std::string& controls);
/// Adds --policy of commands without --program, whose default is the script.
void add_policy_option(CLI::App& app, std::string& policy);
/// Adds --integrator. `usual`: the default.
void add_integrator_option(CLI::App& app, std::string& integrator, const std::string& usual);

/// Solver options of a command line.
struct SolverArguments {
  std::string integrator;  ///< "": the scene's
  std::optional<double> timestep, tolerance, accuracy;
  bool sleep = false;

  void add(CLI::App& app);
  /// As in apply_solver_options(), where the scene's own come first.
  [[nodiscard]] SolverOptions requested() const;
};

}  // namespace tangere::apps
