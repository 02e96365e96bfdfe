// SPDX-License-Identifier: Apache-2.0
// Fits a skin's numbers to a recorded press (docs/calibration.md).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tasks/calibration/force_fit.hpp"
#include "tasks/calibration/press.hpp"
#include "tasks/calibration/press_error.hpp"
#include "tasks/calibration/row_forces.hpp"

namespace tangere {

struct CalibrationRequest {
  /// Makes the scene of placed_indenter(), with the attributes among these numbers in place of the
  /// sensor's own. Others are the sensor's own, whatever scenes were made before. A table has
  /// `knots` pressures [Pa] "pressure[1]", … after 0, evenly spread up to the depth "table_depth"
  /// [m].
  SkinScene scene;
  /// Attributes that may be fitted, with positive values at which the fit begins: `modulus` or
  /// `kn`, and of `relaxation`, `ks` and `mu` those that the sensor can have.
  SkinNumbers start;
  /// Pressures of a table, which is fitted in place of a modulus; 0: none.
  int knots = 0;
  /// What is fitted: names out of start, "pressure" (the table), "zero" [m] which is added to every
  /// depth, "force_zero" [N] which the load cell adds to every force, "lag" [s] of the force behind
  /// the depth, and "slider", a spring [N/m] beside the skin that slips at "slider_force" [N].
  /// Empty: all out of start and "zero", or all and "pressure", and "force_zero" if rows are above
  /// the skin, as far as the recording can tell them.
  std::vector<std::string> numbers{};
  /// Whether anything is fitted if `numbers` is empty.
  bool fit = true;
  /// Whether the normal force of a press without a shear is fitted with the friction that the
  /// sensor has. Without times it is that of a slow press.
  bool friction = false;
  /// Standard deviation of the errors of depths [m]; 0: they have none. Left out, it is estimated
  /// where the recording tells it (told_depth_error()), of forces and not of fields.
  std::optional<double> depth_error{};
  /// Rows that are compared and not fitted, of all; as held_out_rows().
  double hold_out = 0;
};

/// What friction adds to the normal force of a press, and how far it would move the numbers.
struct FrictionShare {
  double mu = 0;                    ///< 0: the sensor has none, or its springs have no memory
  double largest = 0;               ///< of the normal force, over the largest recorded one
  std::vector<FittedNumber> moved;  ///< numbers of the normal force without their intervals: shares
};

/// Errors of the depths that a fit contains.
struct DepthErrorFound {
  double deviation = 0;  ///< [m]; 0: none
  bool estimated = false;
};

struct Calibration {
  std::vector<FittedNumber> numbers;
  std::vector<UntoldNumber> untold;
  std::vector<GivenNumber> given;  ///< zeros that are not fitted
  /// Correlation of the errors of "zero" and "force_zero"; none unless both are fitted.
  std::optional<double> zero_correlation;
  int rows_above = 0;  ///< of the fitted rows, those above the skin
  /// Rows that are not fitted, because the rate of the depth or of the shear jumps there.
  std::vector<int> turns;
  DepthErrorFound depth_error;
  /// What the friction of the sensor adds; what it would move where the fit is without it.
  FrictionShare friction;
  SkinNumbers found;          ///< all numbers that were fitted, and "table_depth"
  std::vector<int> rows;      ///< that are fitted
  std::vector<int> held_out;  ///< rows
  PressError normal, normal_held_out, shear, shear_held_out;
  /// Where nothing slips, so that mu is not told: the largest recorded ratio of shear to normal
  /// force, which is a lower bound of mu; else 0.
  double least_friction = 0;
  bool converged = true;
};

/// Returns which of `rows` are held out, evenly spread: a count from 1 on, or a share below 1.
/// Throws InputError unless one row is left to fit.
std::vector<int> held_out_rows(double hold_out, int rows);

/// Fits. Without a shear, normal forces give all numbers. With a shear, normal forces and those
/// along the skin are fitted together, with friction; each kind counts by its own errors. Throws
/// InputError for a recording without force, for a shear without any, for columns of unlike
/// lengths, for times that do not ascend, for a path on which the sensor has no force, for a
/// requested number that the columns cannot tell, for a table without a positive depth, and for
/// errors of the depth of a field.
Calibration calibrate(const CalibrationRequest& request, const PressRecording& recording);

/// Compares the normal forces of another recording with those of the numbers that were found, at
/// `rows` or at all. Throws InputError for columns as calibrate(), and for one without times if a
/// lag or a relaxation was found.
PressError check_calibration(const CalibrationRequest& request, const SkinNumbers& found,
                             const PressRecording& recording, std::vector<int> rows = {});

}  // namespace tangere
