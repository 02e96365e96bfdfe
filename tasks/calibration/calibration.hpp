// SPDX-License-Identifier: Apache-2.0
// Fits a skin's numbers to a recorded press (docs/calibration.md).
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tasks/calibration/press.hpp"

namespace tangere {

/// Attributes of a sensor by their names in scene files, in the units of its layout.
using SkinAttributes = std::map<std::string, double>;

struct CalibrationRequest {
  /// Makes the scene of placed_indenter(), with these attributes in place of the sensor's own.
  std::function<Scene(const SkinAttributes&)> scene;
  /// Attributes that may be fitted, with positive values at which the fit begins: `modulus` or
  /// `kn`, and of `relaxation`, `ks` and `mu` those that the sensor can have.
  SkinAttributes start;
  /// Names out of start and "zero" that are fitted. Empty: all that the recording may tell.
  std::vector<std::string> numbers;
  /// Rows that are compared and not fitted, of all; as held_out_rows().
  double hold_out = 0;
};

struct FittedNumber {
  std::string name;  ///< "modulus", "kn", "relaxation", "ks", "mu", or "zero" [m]
  double value = 0;
  double low = 0, high = 0;  ///< 95 % interval; infinite where it is not known
};
/// A number that the recording does not tell, and why.
struct UntoldNumber {
  std::string name, reason;
};
/// How far computed forces are off, over the largest recorded one.
struct PressError {
  int rows = 0;
  double root_mean_square = 0, largest = 0;
  double largest_by_row = 0;  ///< over the row's own force, of rows above a hundredth of the peak
};

struct Calibration {
  std::vector<FittedNumber> numbers;
  std::vector<UntoldNumber> untold;
  std::vector<double> force, shear_force;  ///< computed at every row [N]; shear may be empty
  std::vector<int> held_out;               ///< rows
  PressError normal, normal_held_out, shear, shear_held_out;
  bool converged = true;

  /// The fitted attributes: all numbers but zero.
  [[nodiscard]] SkinAttributes attributes() const;
};

/// Returns which of `rows` are held out, evenly spread: a count from 1 on, or a share below 1.
/// Throws InputError unless one row is left to fit.
std::vector<int> held_out_rows(double hold_out, int rows);

/// Fits. Normal forces give stiffness, zero and relaxation; then shear forces give ks and mu.
/// Throws InputError for a recording without force, for columns of unlike lengths, for times that
/// do not ascend, for a path that the sensor does not feel, and for a requested number of which the
/// recording has no row.
Calibration calibrate(const CalibrationRequest& request, const PressRecording& recording);

}  // namespace tangere
