// SPDX-License-Identifier: Apache-2.0
// Tests whether the residual of a fit to recorded fields is noise. Model errors leave residuals
// that are correlated between neighbouring points and readings.
#pragma once

#include <string>

#include "engine/model/model.hpp"
#include "tasks/gradients/field_sequence.hpp"

namespace tangere {

/// With r the residuals of the points of a sensor that the fitted field touches, in one component
/// of one reading: z = Σ r/√(Σ r²). Independent errors with symmetric distributions give z mean 0
/// and mean square 1, whatever their sizes are.
struct ResidualTest {
  /// False: the residual is below kLeast of the recorded fields, their assumed accuracy, or there
  /// are too few sums.
  bool tested = false;
  double spread = 1;       ///< mean of z²
  double persistence = 0;  ///< mean of z times z of the next reading
  double mean = 0;         ///< of z, of that sensor and component in which it is largest
  std::string sensor;      ///< of that mean
  /// Squared model error in variances of noise: Σ (z² - 1), at least 0; or that of the suspect's
  /// change, if it is larger.
  double excess = 0;
  double score = 0;  ///< the largest of all, in standard deviations of independent noise
  /// Mean square of all residuals over the stated variance of the noise; 0 where none is stated.
  double chi_square = 0;
  /// The parameter outside the fit whose change would reduce the residual most, and that relative
  /// change. With J its column of the Jacobian less its projection on those of the fitted ones, and
  /// σ the noise, J·r/(σ |J|) is its score.
  std::string suspect;
  double suspect_score = 0, suspect_change = 0;

  static constexpr double kLeast = 1e-4, kMostScore = 4.5;
  [[nodiscard]] bool is_noise() const { return !tested || score < kMostScore; }
};

/// `noise`: stated standard deviation of a recorded number [N]; 0: not stated.
ResidualTest test_residuals(const Model& model, const FieldSequence& fitted,
                            const FieldSequence& recorded, double noise);

}  // namespace tangere
