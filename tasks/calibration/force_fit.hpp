// SPDX-License-Identifier: Apache-2.0
// Least squares of one recorded force by named numbers, and which of them the force tells.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tasks/calibration/least_squares.hpp"

namespace tangere {

/// Numbers by their names: attributes of a sensor as in scene files, in the units of its layout,
/// and numbers of the recording (calibration.hpp).
using SkinNumbers = std::map<std::string, double>;

struct FittedNumber {
  std::string name;
  double value = 0;
  double low = 0, high = 0;  ///< 95 % interval; infinite where it is not known
};
/// A number that the recording does not tell, and why.
struct UntoldNumber {
  std::string name, reason;
};

/// Names of the numbers of a recording.
inline constexpr const char *kZero = "zero", *kRelaxation = "relaxation", *kShear = "ks",
                            *kFriction = "mu", *kTable = "pressure", *kLag = "lag",
                            *kSlider = "slider", *kSliderForce = "slider_force";

/// Returns "pressure[3]", the name of a number of a table.
std::string table_number(int k);

/// Computes forces at all rows.
using Forces = std::function<std::vector<double>(const SkinNumbers&)>;

class ForceFit {
 public:
  /// `rows`: those that are fitted. `depth`: size of the zero [m]. `knots`: numbers of a table
  /// after its first.
  ForceFit(Forces forces, std::span<const double> recorded, std::vector<int> rows, double depth,
           int knots);

  /// Fits `names` from `start`, with `fixed` numbers. Those that turn out not to be told are listed
  /// in untold() and left out, so that the fit of the rest is without them.
  void run(std::vector<std::string> names, const SkinNumbers& start, SkinNumbers fixed);

  [[nodiscard]] std::vector<FittedNumber> numbers() const;
  [[nodiscard]] const std::vector<UntoldNumber>& untold() const { return untold_; }
  /// All numbers of the fit, the fixed ones included.
  [[nodiscard]] SkinNumbers found() const { return numbers_at(found_.x); }
  [[nodiscard]] bool converged() const { return names_.empty() || found_.converged; }

 private:
  /// How a number follows from an x, which begins at 1: differences are shares of x.
  struct Scale {
    enum class Kind { exponential, square, linear } kind;
    double unit;  ///< the start; linear: the number at x = 2
    [[nodiscard]] double value(double x) const;
    [[nodiscard]] double slope(double x) const;
  };
  [[nodiscard]] Scale scale_of(const std::string& name, const SkinNumbers& start) const;
  [[nodiscard]] SkinNumbers numbers_at(std::span<const double> x) const;
  [[nodiscard]] std::vector<double> residuals(std::span<const double> x) const;
  [[nodiscard]] bool holds(std::size_t friction) const;
  [[nodiscard]] std::size_t weakest() const;
  [[nodiscard]] FittedNumber interval(std::size_t k) const;

  Forces forces_;
  std::span<const double> recorded_;
  std::vector<int> rows_;
  double peak_, depth_;
  int knots_;
  std::vector<std::string> names_;  // of a table: of its increments
  SkinNumbers fixed_;
  std::vector<Scale> scales_;
  LeastSquares found_;
  std::vector<UntoldNumber> untold_;
};

}  // namespace tangere
