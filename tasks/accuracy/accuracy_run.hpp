// SPDX-License-Identifier: Apache-2.0
// Runs fixed episodes with one setting after another and compares samples with a reference.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/base/precision.hpp"
#include "tasks/accuracy/fixed_episodes.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// The compared quantity.
enum class AccuracyQuantity {
  tactile,  ///< the fields of all sensors; error relative to the norm of the reference's
  state,    ///< q; error relative to the range that each coordinate covers
  /// Derivatives of ½ Σ |T|² of all sensors (without a sensor, of ½ Σ |v|²) over the samples, by
  /// the controls between samples; without motors, by the start. Error relative to the norm, where
  /// each motor's or dof's derivatives are divided by the largest of them.
  gradient,
};
const char* to_string(AccuracyQuantity value);
/// The same in words.
const char* accuracy_meaning(AccuracyQuantity value);

struct AccuracySetting {
  Integrator integrator = Integrator::default_integrator;
  int parts = 1;  ///< steps between samples
  double tolerance = 1e-9;
  double accuracy = 0;  ///< of the parts of a step; 0: every step is one part
  /// No explicit tolerance: the engine uses its default and may skip final evaluations; `tolerance`
  /// is the value in force.
  bool follows = false;

  bool operator==(const AccuracySetting&) const = default;
};

/// The two precisions in which fields are read, as indices below.
inline constexpr std::array kPrecisions = {Precision::f64, Precision::mixed};

/// Cost and error of a setting. A failed environment has an infinite error.
struct AccuracyOutcome {
  /// (precisions, E) ‖x - x_ref‖/‖x_ref‖ over samples; NaN where the reference is zero throughout,
  /// or failed.
  std::array<std::vector<double>, kPrecisions.size()> error;
  double step_seconds = 0;                                ///< CPU time of all steps
  std::array<double, kPrecisions.size()> read_seconds{};  ///< CPU time of reading fields
  StepCounts counts;                        ///< of gradients: steps and evaluations alone
  double simulated_seconds = 0;             ///< over all environments
  std::vector<FailedEnvironment> failures;  ///< steps count from the start of the episode
  bool stopped = false;
};

/// If `stop` is requested, runs end before the next sample of a block.
class AccuracyRun {
 public:
  virtual ~AccuracyRun() = default;
  /// Plays with a setting and keeps its samples as the reference. Errors are left empty.
  virtual AccuracyOutcome make_reference(const AccuracySetting& setting,
                                         const std::stop_token& stop) = 0;
  /// Plays with a setting and compares with the reference, which must have been made.
  virtual AccuracyOutcome compare(const AccuracySetting& setting, const std::stop_token& stop) = 0;
};

/// `episodes` must outlive the result. Throws InputError for tactile without a sensor, and if the
/// threads cannot be started. Runs with gradients throw like GradientRollouts.
std::unique_ptr<AccuracyRun> make_accuracy_run(const FixedEpisodes& episodes,
                                               AccuracyQuantity quantity, int threads);

/// (E) √(squared_distance/squared_norm); NaN where there is no reference or the norm is 0, infinite
/// where an environment failed.
std::vector<double> relative_errors(std::span<const double> squared_distance,
                                    std::span<const double> squared_norm,
                                    std::span<const char> no_reference,
                                    std::span<const FailedEnvironment> failures);

/// Steps of the finest reference in a timestep of the scene.
inline constexpr int kFinestParts = 128;

/// Memory of the reference, if a tenth of the points is touched; for gradients including tapes
/// [bytes].
double accuracy_bytes(const FixedEpisodes& episodes, AccuracyQuantity quantity, int threads);

}  // namespace tangere
