// SPDX-License-Identifier: Apache-2.0
// Runs hard cases over schemes and step lengths and evaluates their criteria.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "tasks/run/step_counts.hpp"
#include "tasks/stress/stress_case.hpp"

namespace tangere {

/// Result of a setting of a case.
enum class StressVerdict {
  holds,    ///< the criterion is met
  flagged,  ///< not met, and reported: by a status, a warning, or an error for the scene
  fails,    ///< not met, and not reported
};
const char* to_string(StressVerdict value);

/// One case with one scheme and one step.
struct StressRow {
  const StressCase* of = nullptr;
  Integrator integrator = Integrator::default_integrator;
  double step = 0;           ///< [s]
  double accuracy = 0;       ///< of its parts; 0: steps are not cut
  double value = 0;          ///< measured, in the worst environment that did not fail; NaN: none
  double evaluations = 0;    ///< of the residual, per step
  int most_evaluations = 0;  ///< in one step of one environment
  StepCounts counts;         ///< of all environments
  int environments = 0, failed = 0;
  StressVerdict verdict = StressVerdict::fails;
  std::string reason;  ///< why it is flagged; "" otherwise
};

struct StressOptions {
  std::string name;                      ///< of one case; "": all
  std::optional<Integrator> integrator;  ///< instead of the case's schemes
  std::optional<double> step;            ///< instead of the case's steps [s]
  /// Cuts steps into parts that keep it. Schemes without an estimate are then left out.
  std::optional<double> accuracy;
  bool quick = false;  ///< quick cases alone, each at its first step and with at most
                       ///< two environments
  int threads = 1;
};

struct StressReport {
  std::vector<StressRow> rows;
  bool stopped = false;
};

/// A scene, and the warnings of its reader.
struct StressScene {
  Scene scene;
  std::vector<std::string> warnings{};
};
/// Returns a scene by its name below scenes/. Throws InputError where it cannot be read.
using StressScenes = std::function<StressScene(const std::string& file)>;

struct StressListener {
  std::stop_token stop;                       ///< ends the run before any step of a block
  std::function<void(const StressRow&)> row;  ///< each as it is measured
};

/// Plays the cases that the options name, in their order. A stop leaves the rows before it. A scene
/// that is refused is a flagged row. Throws InputError when no case has the name.
StressReport run_stress(std::span<const StressCase> cases, const StressOptions& options,
                        const StressScenes& scenes, const StressListener& listener);

/// The names of the cases, in their order.
std::vector<std::string> stress_names(std::span<const StressCase> cases);

}  // namespace tangere
