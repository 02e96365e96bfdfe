// SPDX-License-Identifier: Apache-2.0
// Sweeps scheme, step, precision and tolerance over fixed episodes, and finds the cheapest setting
// that meets an error target.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tasks/accuracy/accuracy_run.hpp"
#include "tasks/accuracy/pitch_sweep.hpp"
#include "tasks/accuracy/vibration.hpp"

namespace tangere {

struct AccuracyOptions {
  AccuracyQuantity quantity = AccuracyQuantity::tactile;
  double target = 1e-2;             ///< relative error
  std::optional<double> tolerance;  ///< of all settings; none: the one that follows the step
  int threads = 1;
  /// A setting whose error meets the target but whose bound does not is run again if its rate is
  /// more than this multiple of the best rate whose bound does.
  double worth_repeating = 1.1;
};

/// One setting in one precision.
struct AccuracyPoint {
  AccuracySetting setting;
  Precision precision = Precision::f64;  ///< of fields
  double step = 0;                       ///< [s]
  double error = 0;  ///< not exceeded in 95 % of the environments; infinite if more than 5 % failed
  /// Upper bound of the 95 % quantile with 95 % confidence. With fewer than 59 environments there
  /// is no such bound; it is then the largest error.
  double bound = 0;
  double median = 0;  ///< of the errors of environments
  /// Of cut steps: share of the environments whose error is 0.3 to 3 times the accuracy; else NaN.
  double within = 0;
  double evaluations = 0;  ///< of the residual, per step
  double split = 0;        ///< share of steps; NaN for gradients, which do not count them
  double rate = 0;         ///< simulated seconds per CPU second, over all environments
  bool blurred = false;    ///< error at most ten times the reference's own
  /// Of every environment, then of those of the confirmation run; as in AccuracyOutcome.
  std::vector<double> errors{};
  int failed = 0;      ///< environments
  std::string status;  ///< "ok", or why environments failed
};

struct AccuracyReference {
  AccuracySetting setting;
  StepCounts counts;  ///< of its steps
  double step = 0;    ///< [s]
  /// 95 % quantile over environments of the larger of two estimates: the distance to SDIRK2 at the
  /// same step, and Richardson extrapolation from twice and four times the step (richardson()).
  double error = 0;
  double scheme_distance = 0, step_distance = 0;  ///< to SDIRK2, and to itself with twice the step
  /// That its own steps have on these episodes (richardson()).
  double order = 0;
  int environments = 0;  ///< with a valid reference
  int failed = 0;        ///< environments in which the reference or SDIRK2 failed
  std::string status;    ///< "ok", or why

  /// Whether all schemes share most of the error: another one at the same step is nearer than the
  /// motion itself.
  [[nodiscard]] bool shares_errors() const { return error > 2 * scheme_distance; }
};

/// The order that a scheme has on these episodes between its two finest steps, without those that
/// are off by less than ten times the reference; with them where the reference shares their errors.
struct SchemeOrder {
  Integrator integrator = Integrator::default_integrator;
  double coarse = 0, fine = 0;  ///< those steps [s]
  double order = 0;             ///< of the medians of the errors
};

struct AccuracyReport {
  AccuracyReference reference;
  std::vector<SchemeOrder> orders;  ///< of the schemes that have two such steps
  /// Scheme by step by precision, then steps that are cut to keep an accuracy.
  std::vector<AccuracyPoint> points;
  std::vector<AccuracyPoint> tolerances;  ///< tolerances alone, at the setting of the advice
  std::vector<PitchSweep> pitches;        ///< of tactile fields: every sensor
  AccuracyPoint own;                      ///< the scene's setting: its scheme, step and tolerance
  /// Index of the cheapest point whose bound and the reference's error together meet the target;
  /// -1: none does.
  int advice = -1;
  bool resolved = false;  ///< the error of the reference is small enough for the comparison
  Vibration vibration;    ///< where it is not
  bool stopped = false;
};

/// Callbacks during a sweep.
struct AccuracyListener {
  std::stop_token stop;                                         ///< ends it before any sample
  std::function<void(const AccuracyReference&)> reference;      ///< each attempt, ever finer
  std::function<void(std::span<const AccuracyPoint>)> setting;  ///< in every precision
  std::function<void()> before_confirmation{};                  ///< before the confirmation run
};

/// Makes episodes of the same kind with random numbers that no others have; none when stopped.
using FreshEpisodes = std::function<std::optional<FixedEpisodes>()>;

/// A requested stop returns the points measured so far. At most three settings whose error meets
/// the target but whose bound does not, the fastest first, are run again on `fresh` episodes
/// (worth_repeating); their errors are then over all environments. Throws InputError if
/// nothing touches in any environment, or nothing moves.
AccuracyReport accuracy_sweep(const FixedEpisodes& episodes, const AccuracyOptions& options,
                              const AccuracyListener& listener, const FreshEpisodes& fresh = {});

/// Makes the reference and compares the scene's own setting with it: `reference`, `own` and
/// `resolved` of a report. Throws like accuracy_sweep.
AccuracyReport own_accuracy(const FixedEpisodes& episodes, const AccuracyOptions& options,
                            const AccuracyListener& listener);

}  // namespace tangere
