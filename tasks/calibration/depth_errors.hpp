// SPDX-License-Identifier: Apache-2.0
// Errors of recorded depths in a fit of forces (docs/calibration.md#errors-of-the-depth). A depth
// that is off by e moves the force F that is computed at it by F' e, and with relaxation it moves
// the rates of its neighbours. With independent e of the deviation σ_d, differences to recorded
// forces have the covariance
//   C = σ_F² I + σ_d² B Bᵀ
// σ_F is that of forces along the normal or along the skin, and column j of B has the slopes of all
// forces by the depth of row j. Forces are linear around depths d - ê from which the likely errors
// ê = σ_d² Bᵀ C⁻¹ r are taken, so with C = L Lᵀ the residuals are L⁻¹ r,
//   r = F(d - ê) + B ê - F'' σ_η²/2 - recorded
// where σ_η is the deviation of e - ê. These are least where the numbers of the fit move C, too: so
// slopes are not attenuated, and the weight of a row does not depend on its own error.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include "tasks/calibration/force_fit.hpp"
#include "tasks/calibration/press.hpp"
#include "tasks/calibration/row_forces.hpp"

namespace tangere {

/// Computes the forces of all rows, in the order of FitRows, with each of the shifts.
using ShiftedForces = std::function<std::vector<std::vector<double>>(const SkinNumbers&,
                                                                     std::span<const DepthShift>)>;

class DepthErrors {
 public:
  /// `deviation`: σ_d > 0 [m]. `rates`: whether forces depend on the rate of the depth.
  DepthErrors(ShiftedForces forces, const PressRecording& recording, FitRows rows, double deviation,
              bool rates);

  /// Computes r of all rows without the recorded forces.
  std::vector<double> forces(const SkinNumbers& numbers);

  /// Chooses σ_F of both kinds of forces so that what is left has the size that is expected, and ê.
  /// `off`: r of all rows. `deviations`: as ForceFit::force_errors() of a fit that does not have
  /// errors of the depth.
  void choose_errors(const SkinNumbers& numbers, const std::vector<double>& off,
                     const std::array<double, 2>& deviations);

  /// Returns L⁻¹ `off` of the fitted rows.
  std::vector<double> whitened(const SkinNumbers& numbers, const std::vector<double>& off);

  /// Returns the root mean square error of forces along the normal by those of depths [N].
  double size(const SkinNumbers& numbers);

  /// Returns F' of all rows [N/m].
  std::vector<double> slopes(const SkinNumbers& numbers);

  [[nodiscard]] const FitRows& rows() const { return rows_; }

 private:
  struct Slopes {
    SkinNumbers numbers;
    std::vector<double> forces, depth, bend, rate;  ///< F, F', F'', and by the rate
    bool set = false;
  };
  /// A force's slopes by the depths of a row and of those before and after it.
  struct DepthSlopes {
    std::array<int, 3> row;
    std::array<double, 3> slope;
  };
  const Slopes& at(const SkinNumbers& numbers);
  [[nodiscard]] DepthSlopes slopes_at(const Slopes& s, std::size_t force) const;
  [[nodiscard]] std::size_t kind(std::size_t force) const;
  [[nodiscard]] double covariance(const DepthSlopes& a, const DepthSlopes& b) const;
  [[nodiscard]] std::vector<std::size_t> fitted() const;
  [[nodiscard]] double left_variance(const Slopes& s, std::size_t row) const;
  void scale_force_errors(const SkinNumbers& numbers, const std::vector<double>& off,
                          double freedom);
  struct Factor {
    std::size_t band = 0;
    std::vector<double> numbers;  ///< (n, band): L at i, i - band + 1 …
    std::vector<DepthSlopes> by;
    double& at(std::size_t i, std::size_t j) { return numbers[i * band + (j + band - 1 - i)]; }
  };
  [[nodiscard]] Factor factor(const Slopes& s) const;

  ShiftedForces forces_;
  const PressRecording& recording_;
  FitRows rows_;
  double deviation_, rate_step_ = 0;
  std::array<double, 2> force_error_{1, 1};
  std::vector<double> error_;  ///< ê of all rows, or empty
  Slopes slopes_;
};

/// Returns the standard deviation of errors of the depth that a recording tells [m]: that of
/// PressRecording::depth_scatter(), if differences of forces from a fit follow the depths' own
/// fourth differences as far as errors of this size do, and are no smaller part of the forces'
/// errors than a fifth; else 0. `off`: forces less those recorded, of all rows.
double told_depth_error(DepthErrors& errors, const PressRecording& recording,
                        const SkinNumbers& numbers, std::span<const double> off);

}  // namespace tangere
