// SPDX-License-Identifier: Apache-2.0
// Every command that has one of these options adds it here.
#include "apps/run_options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/scene_run.hpp"

namespace tangere::apps {

void add_steps_option(CLI::App& app, std::optional<std::int64_t>& steps,
                      const std::string& description) {
  add_whole_number<std::int64_t>(app, "--steps", steps, 1, kMostSteps, description);
}

void add_envs_option(CLI::App& app, std::optional<int>& environments,
                     const std::string& description) {
  add_whole_number<int>(app, "--envs", environments, 1, kMostEnvironments, description);
}

void add_every_option(CLI::App& app, std::optional<int>& every, const std::string& description) {
  add_whole_number<int>(app, "--every", every, 1, kMostEnvironments, description);
}

void add_threads_option(CLI::App& app, std::optional<int>& threads,
                        const std::string& description) {
  add_whole_number<int>(app, "--threads", threads, 1, kMostThreads, description);
}

void add_seed_option(CLI::App& app, std::optional<std::uint64_t>& seed,
                     const std::string& description) {
  add_whole_number<std::uint64_t>(app, "--seed", seed, 0, UINT64_MAX, description);
}

void add_precision_option(CLI::App& app, std::string& precision, const std::string& meaning) {
  add_text(app, "--precision", precision, "NAME",
           "Precision of tactile fields: double, or mixed" + meaning);
}

void add_overwrite_option(CLI::App& app, bool& overwrite, const std::string& description) {
  add_flag(app, "--overwrite", overwrite, description);
}

void add_accuracy_option(CLI::App& app, std::optional<double>& accuracy) {
  add_positive_number(app, "--accuracy", accuracy,
                      "Cut steps into parts that keep this relative accuracy, such as 0.01 "
                      "[default: the scene's, or steps are not cut]");
}

void add_sleep_option(CLI::App& app, bool& sleep) {
  add_flag(app, "--sleep", sleep,
           "Let bodies sleep that have come to rest, until something touches or moves them");
}

void add_allow_unknown_option(CLI::App& app, bool& allow) {
  add_flag(app, "--allow-unknown", allow,
           "Unknown elements and attributes of the scene are warnings, not errors");
}

void add_controls_option(CLI::App& app, std::string& controls) {
  add_text(app, "--controls", controls, "U.csv",
           "Table of controls, one row per step, in place of the scene's <control>; for a task, of "
           "actions");
}

void add_policy_option(CLI::App& app, std::string& policy) {
  add_text(
      app, "--policy", policy, "NAME",
      "Policy of a task: random, hold, csv (needs --controls) or scripted [default: scripted]");
}

void add_integrator_option(CLI::App& app, std::string& integrator, const std::string& usual) {
  add_text(app, "--integrator", integrator, "NAME",
           fmt::format("{} [default: {}]", fmt::join(integrator_names(), ", "), usual));
}

void SolverArguments::add(CLI::App& app) {
  add_positive_number(app, "--timestep", timestep, "Step size in s [default: the scene's]");
  add_integrator_option(app, integrator, "the scene's");
  add_positive_number(
      app, "--tol", tolerance,
      "Largest scaled residual of a step [default: the scene's, or what follows scheme and step]");
  add_accuracy_option(app, accuracy);
  add_sleep_option(app, sleep);
}

SolverOptions SolverArguments::requested() const {
  return {.accuracy = accuracy, .sleep = sleep ? kUsualSleep : 0};
}

}  // namespace tangere::apps
