// SPDX-License-Identifier: Apache-2.0
// Finds numbers of a scene from recorded tactile fields: least squares over a rollout, with the
// gradient from the adjoint.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/model/model.hpp"
#include "tasks/gradients/field_sequence.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/residual_test.hpp"

namespace tangere {

/// Returns the values of a scene's numbers by their names ("tactile pad kn"), and the scene with
/// other values. Both throw InputError for a name that the scene does not have.
std::vector<double> numbers_of(const Scene& scene, std::span<const std::string> names);
Scene with_numbers(const Scene& scene, std::span<const std::string> names,
                   std::span<const double> values);

/// The recorded run, from the state that the scene gives.
struct RecordedRun {
  StepControls controls;  ///< for environment 0
  std::int64_t steps = 0;
  std::int64_t every = 1;
};

/// Simulates the fields of the scene under these controls. Throws InputError when an environment
/// fails.
FieldSequence simulate_fields(const Scene& scene, const RecordedRun& run);

/// Memory of a fit of `numbers` parameters to such a run [bytes].
double identification_bytes(const Model& model, const RecordedRun& run, std::size_t numbers);

/// Adds independent normal noise to every number of every field.
void add_noise(FieldSequence& sequence, double deviation, std::uint64_t seed);

/// ½ Σ (T − T_recorded)² over all readings that the rollout reaches, points and components [N²].
class FieldMisfit : public RolloutLoss {
 public:
  FieldMisfit(const Model& model, const FieldSequence& recorded);
  [[nodiscard]] bool reads_fields(std::int64_t step) const override {
    return step > 0 && step % recorded_.every == 0 &&
           step / recorded_.every <= std::int64_t(recorded_.readings.size());
  }
  double evaluate(const LossPoint& at, const LossCotangent& out) const override;

 private:
  Model model_;
  const FieldSequence& recorded_;                           // outlives this
  std::vector<std::vector<std::vector<TilePoint>>> tiles_;  // of every sensor
  std::vector<std::vector<double>>
      squares_;  // ½ |T_recorded|² of every sensor's tiles, for each reading
};

struct IdentificationOptions {
  std::vector<std::string>
      numbers;              ///< sought numbers by name_of(); positive, fitted as logarithms
  int max_iterations = 60;  ///< rollouts with gradients, rejected steps included
  double tolerance = 1e-2;  ///< ends at a step worth this many standard deviations
  /// Largest number of fits. The first starts at the scene's values, others at these times random
  /// factors of ¼ to 4, until the residual of a fit is noise and its parameters are identifiable.
  int starts = 6;
  std::uint64_t seed = 1;  ///< of the factors
  double noise = 0;        ///< stated standard deviation of a recorded number [N]; 0: not stated
};

/// One accepted point of the fit.
struct FitPoint {
  std::vector<double> values;
  double misfit = 0;    ///< [N²]
  double gradient = 0;  ///< |∂ misfit / ∂ logarithms| [N²]
};

/// Where a fit began and ended.
struct FitEnds {
  std::vector<double> start, end;  ///< values of the numbers
  double misfit = 0;               ///< at the end [N²]; infinite where a rollout failed
  bool converged = false;
};

/// The fit with the smallest misfit.
struct Identification {
  std::vector<FitPoint> points;  ///< the start first
  bool converged = false;
  double noise = 0;  ///< standard deviation of a residual at the end [N]
  /// Standard deviations of the logarithms, from the inverse of the information. If the residual is
  /// not noise, times √(1 + residual.excess), which assumes that the model error absorbed by the
  /// parameters is as large as the remaining one. Infinite for unidentifiable parameters.
  std::vector<double> deviation;
  std::vector<double> information;  ///< (n, n) Fisher: JᵀJ / noise², J by logarithms
  std::vector<double> correlation;  ///< (n, n) of the estimates
  double condition = 0;  ///< largest eigenvalue of the information over the smallest, at most 1/ε
  /// Indices of parameters that the fields do not identify: those of the weakest direction if its
  /// information vanishes, and those whose standard deviation exceeds kMostDeviation.
  std::vector<int> inseparable;
  double gradient_difference =
      0;  ///< at the start, |adjoint − Jᵀr| / |Jᵀr|; J from central differences
  ResidualTest residual;
  std::vector<FitEnds> fits;  ///< all of them, in their order

  static constexpr double kMostDeviation = 0.5;
  [[nodiscard]] const std::vector<double>& values() const { return points.back().values; }
  /// Whether it converged, its parameters are identifiable, and its residual is noise.
  [[nodiscard]] bool passed() const {
    return converged && inseparable.empty() && residual.is_noise();
  }
};

/// Fits by Levenberg-Marquardt in logarithms. The gradient comes from rollout_gradients, JᵀJ from
/// one central difference of the whole sequence per number. Throws
/// InputError for a name that is not a number of the scene, a value that is not positive, a number
/// that no field depends on, a recording that does not fit the run, and a start whose rollout
/// fails.
Identification identify(const Scene& scene, const RecordedRun& run, const FieldSequence& recorded,
                        const IdentificationOptions& options);

}  // namespace tangere
