// SPDX-License-Identifier: Apache-2.0
// Least squares of one recorded force by named numbers, and which of them the force tells.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
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
/// A number of the recording that is taken as 0, and what an error of it does.
struct GivenNumber {
  std::string name;
  double error = 0;   ///< a hundredth of the largest depth [m] or force [N]
  std::string moved;  ///< the number that it moves
  double change = 0;  ///< by this share
  bool told = true;   ///< whether the other numbers could not take its place
};

/// Names of the numbers of a recording.
inline constexpr const char *kZero = "zero", *kForceZero = "force_zero",
                            *kRelaxation = "relaxation", *kShear = "ks", *kFriction = "mu",
                            *kTable = "pressure", *kLag = "lag", *kSlider = "slider",
                            *kSliderForce = "slider_force", *kPlaceX = "x_zero",
                            *kPlaceY = "y_zero";

/// Returns "pressure[3]", the name of a number of a table.
std::string table_number(int k);

/// Computes forces at all rows, one after the other.
using Forces = std::function<std::vector<double>(const SkinNumbers&)>;

/// The rows that are fitted, and the forces that each has.
struct FitRows {
  std::vector<int> rows;
  std::size_t width = 1;   ///< forces of a row
  bool alike = false;      ///< whether errors of the forces of a row may be alike
  std::size_t normal = 0;  ///< the first of a row are along the normal, the rest along the skin;
                           ///< 0: all are of one kind
  double weight = 1;       ///< of forces along the skin, by that of those along the normal
};

/// Returns residuals of the fitted rows with errors of a variance of 1 from differences of all
/// rows [N]: their errors may be of different sizes, and depend on one another.
using Whitening =
    std::function<std::vector<double>(const SkinNumbers&, const std::vector<double>& off)>;

/// Where a fit begins.
struct FitStart {
  SkinNumbers scale;  ///< sizes of the numbers
  SkinNumbers at{};   ///< where numbers of these names begin; others at their sizes, zeros at 0
  std::vector<std::string> settled{};  ///< names that are not left out
};

class ForceFit {
 public:
  /// `depth`: size of the zero [m]. `knots`: numbers of a table after its first. Without
  /// `whitening` residuals are forces by the peak.
  ForceFit(Forces forces, std::span<const double> recorded, FitRows rows, double depth, int knots,
           Whitening whitening = {});

  /// Fits `names` from `start`, with `fixed` numbers. Those that turn out not to be told are listed
  /// in untold() and left out, so that the fit of the rest is without them. `held`: numbers that
  /// are not fitted because the recording does not tell them. The intervals of the others contain
  /// that they are not known.
  void run(std::vector<std::string> names, const FitStart& start, SkinNumbers fixed,
           std::vector<std::string> held = {});
  /// Adds the errors of the numbers of an earlier fit, on which these forces depend, to the
  /// intervals.
  void add_errors_of(const ForceFit& before);

  [[nodiscard]] std::vector<FittedNumber> numbers() const;
  /// What a zero that is not fitted does. `name`: kZero or kForceZero.
  [[nodiscard]] GivenNumber given(const std::string& name) const;
  /// Returns by how much each number moves if the computed forces have an addition [N], of all
  /// rows; without intervals.
  [[nodiscard]] std::vector<FittedNumber> moves(std::span<const double> addition) const;
  /// Holds a zero that is not fitted, as run().
  void hold(const std::string& name);
  /// Correlation of the errors of two numbers; none unless both are fitted.
  [[nodiscard]] std::optional<double> correlation(const std::string& a, const std::string& b) const;
  [[nodiscard]] const std::vector<UntoldNumber>& untold() const { return untold_; }
  /// Standard deviations of the errors of forces along the normal and of those along the skin [N];
  /// -1 where there are no more of them than numbers.
  [[nodiscard]] std::array<double, 2> force_errors() const;
  /// Names that were fitted, of a table one for each number.
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
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
    [[nodiscard]] double place(double value) const;  ///< x of a value
  };
  [[nodiscard]] std::vector<double> begin(const SkinNumbers& at) const;
  [[nodiscard]] Scale scale_of(const std::string& name, const SkinNumbers& start) const;
  [[nodiscard]] SkinNumbers numbers_at(std::span<const double> x) const;
  [[nodiscard]] ErrorModel errors() const;
  [[nodiscard]] std::vector<double> weighed(const SkinNumbers& numbers,
                                            const std::vector<double>& off) const;
  [[nodiscard]] std::vector<FittedNumber> answers(std::span<const double> change) const;
  [[nodiscard]] std::vector<double> residuals_of(const SkinNumbers& numbers) const;
  [[nodiscard]] std::vector<double> residuals(std::span<const double> x) const;
  [[nodiscard]] std::vector<double> slope_by(const std::string& held) const;
  [[nodiscard]] SkinNumbers moved(std::size_t number, double dx) const;
  [[nodiscard]] bool holds(std::size_t friction) const;
  [[nodiscard]] bool vanishes() const;
  [[nodiscard]] std::vector<double> secant(std::size_t k, double step) const;
  [[nodiscard]] std::vector<double> half_intervals() const;
  [[nodiscard]] double secant_step(std::size_t k, double length) const;
  [[nodiscard]] bool is_smooth() const;
  void find_secants();
  void find_confidence();
  [[nodiscard]] std::size_t weakest() const;
  [[nodiscard]] FittedNumber interval(std::size_t k) const;

  Forces forces_;
  std::span<const double> recorded_;
  FitRows rows_;
  double peak_, depth_;
  int knots_;
  Whitening whitening_;
  std::vector<std::string> settled_;
  std::vector<std::string> names_;  // of a table: of its increments
  std::vector<std::string> held_;
  SkinNumbers fixed_;
  std::vector<Scale> scales_;
  LeastSquares found_;
  Confidence confidence_;  // of names_ and then held_
  std::vector<UntoldNumber> untold_;
};

}  // namespace tangere
