// SPDX-License-Identifier: Apache-2.0
// Two fits by least squares, of the normal and then of the shear force. Stiffnesses and friction
// are fitted as logarithms, the relaxation as the square of a root, the zero in shares of the
// depth.
#include "tasks/calibration/calibration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "tasks/calibration/least_squares.hpp"

namespace tangere {
namespace {

constexpr double kNoInfluence = 1e-6;  // root mean square change, of the peak, by a whole number
constexpr double kStuck = 1e3, kSlipStart = 0.9;  // of the largest ratio of shear to normal force
constexpr double kStiffStart = 3;                 // of the spring that fits without slip
constexpr double kLeastSlip = 0.03;               // share of the forces that slip, by their squares
constexpr double kSmallest = 0.01;  // of the peak: smaller forces have no error of their own

const std::string kZero = "zero", kRelaxation = "relaxation", kShear = "ks", kFriction = "mu";

double peak_of(std::span<const double> force) {
  double peak = 0;
  for (const double f : force) peak = std::max(peak, std::abs(f));
  return peak;
}

PressError error_of(std::span<const double> computed, std::span<const double> recorded,
                    std::span<const int> rows) {
  PressError out;
  const double peak = peak_of(recorded);
  for (const int row : rows) {
    const double f = recorded[std::size_t(row)], off = std::abs(computed[std::size_t(row)] - f);
    out.root_mean_square += off * off;
    out.largest = std::max(out.largest, off / peak);
    if (std::abs(f) > kSmallest * peak)
      out.largest_by_row = std::max(out.largest_by_row, off / std::abs(f));
  }
  out.rows = int(rows.size());
  if (out.rows > 0) out.root_mean_square = std::sqrt(out.root_mean_square / out.rows) / peak;
  return out;
}

/// How a number follows from an x of the fit, which begins at 1: differences are shares of x.
struct Scale {
  enum class Kind { exponential, square, linear } kind;
  double unit;  ///< the start; linear: the number at x = 2

  [[nodiscard]] double value(double x) const {
    if (kind == Kind::exponential) return unit * std::exp(x - 1);
    return kind == Kind::square ? unit * x * x : unit * (x - 1);
  }
  /// Returns the end of an interval of half width `half` on one side.
  [[nodiscard]] double end(double x, double half) const {
    if (std::isinf(half)) return kind == Kind::exponential && half < 0 ? 0 : half;
    return kind == Kind::square ? value(x) + 2 * unit * x * half : value(x + half);
  }
};

Scale scale_of(const std::string& name, double start, double depth) {
  if (name == kZero) return {Scale::Kind::linear, depth};
  return {name == kRelaxation ? Scale::Kind::square : Scale::Kind::exponential, start};
}

/// Computes forces at all rows from attributes and the zero of the depth.
using Forces = std::function<std::vector<double>(const SkinAttributes&, double zero)>;

/// One of the two fits.
class Fit {
 public:
  Fit(Forces forces, std::span<const double> recorded, std::vector<int> rows, double depth)
      : forces_(std::move(forces)),
        recorded_(recorded),
        rows_(std::move(rows)),
        peak_(peak_of(recorded)),
        depth_(depth) {}

  /// Fits `names` from `start`, with `fixed` attributes. Those that turn out not to be told are
  /// listed and left out.
  void run(std::vector<std::string> names, const SkinAttributes& start, SkinAttributes fixed,
           Calibration& out) {
    for (;;) {
      names_ = names;
      fixed_ = fixed;
      scales_.clear();
      std::vector<double> x;
      for (const std::string& name : names) {
        scales_.push_back(scale_of(name, name == kZero ? 0 : start.at(name), depth_));
        x.push_back(1);
      }
      if (names.empty()) break;
      found_ = minimise([&](std::span<const double> at) { return residuals(at); }, x);
      const std::size_t weak = weakest();
      if (weak == names.size()) break;
      out.untold.push_back({names[weak], reason(names[weak])});
      if (names[weak] == kFriction) fixed[kFriction] = scales_[weak].value(found_.x[weak]);
      names.erase(names.begin() + std::ptrdiff_t(weak));
    }
    if (names.empty()) return;
    out.converged = out.converged && found_.converged;
    for (std::size_t k = 0; k < names.size(); ++k) {
      const double x = found_.x[k], half = found_.half_interval[k];
      out.numbers.push_back(
          {names[k], scales_[k].value(x), scales_[k].end(x, -half), scales_[k].end(x, half)});
    }
  }
  [[nodiscard]] std::vector<double> computed() const {
    return forces(names_.empty() ? std::vector<double>{} : found_.x);
  }

 private:
  [[nodiscard]] std::vector<double> forces(std::span<const double> x) const {
    SkinAttributes attributes = fixed_;
    double zero = 0;
    for (std::size_t k = 0; k < names_.size(); ++k)
      (names_[k] == kZero ? zero : attributes[names_[k]]) = scales_[k].value(x[k]);
    return forces_(attributes, zero);
  }
  /// Over the peak, at the rows that are fitted.
  [[nodiscard]] std::vector<double> residuals(std::span<const double> x) const {
    const std::vector<double> computed = forces(x);
    std::vector<double> out;
    for (const int row : rows_)
      out.push_back((computed[std::size_t(row)] - recorded_[std::size_t(row)]) / peak_);
    return out;
  }
  /// Whether a friction that is a hundredth larger leaves the forces as they are.
  [[nodiscard]] bool holds(std::size_t friction) const {
    std::vector<double> x = found_.x;
    const std::vector<double> now = residuals(x);
    x[friction] += 0.01;
    const std::vector<double> then = residuals(x);
    double squares = 0;
    for (std::size_t k = 0; k < now.size(); ++k) squares += std::pow(then[k] - now[k], 2);
    return std::sqrt(squares / double(now.size())) < 0.01 * kLeastSlip;
  }
  /// Returns the first number that has no influence, or whose interval includes none of it.
  [[nodiscard]] std::size_t weakest() const {
    for (std::size_t k = 0; k < names_.size(); ++k) {
      if (found_.influence[k] < kNoInfluence) return k;
      if (names_[k] == kFriction && holds(k)) return k;
      if (names_[k] == kRelaxation && !(scales_[k].end(found_.x[k], -found_.half_interval[k]) > 0))
        return k;
    }
    return names_.size();
  }
  static std::string reason(const std::string& name) {
    if (name == kFriction)
      return "nothing slips, so it exceeds every ratio of shear to normal force";
    if (name == kRelaxation) return "the rates of the recording do not show it";
    if (name == kShear) return "everything slips";
    return "the forces do not change with it";
  }

  Forces forces_;
  std::span<const double> recorded_;
  std::vector<int> rows_;
  double peak_, depth_;
  std::vector<std::string> names_;
  SkinAttributes fixed_;
  std::vector<Scale> scales_;
  LeastSquares found_;
};

void check(const PressRecording& r) {
  if (r.rows() == 0) throw InputError("a recording without depths; expected one row at least");
  for (const auto& [name, column] : {std::pair{"force", &r.force},
                                     {"time", &r.time},
                                     {"shear", &r.shear},
                                     {"shear force", &r.shear_force}})
    if (column->size() != r.rows() && (!column->empty() || column == &r.force))
      throw InputError(
          fmt::format("a recording of {} depths and {} numbers of {}; expected as many", r.rows(),
                      column->size(), name));
  if (r.shear.empty() != r.shear_force.empty())
    throw InputError("shear without its force, or the force without it; expected both or none");
  for (std::size_t k = 1; k < r.time.size(); ++k)
    if (!(r.time[k] > r.time[k - 1]))
      throw InputError(fmt::format("row {}: time {} s after {} s; expected ascending times", k + 1,
                                   r.time[k], r.time[k - 1]));
  if (!(peak_of(r.force) > 0))
    throw InputError("a recording without any force; expected a press of the skin");
}

/// Why a recording cannot tell a number, whatever the fit finds; "" if it may.
std::string reason_against(const std::string& name, const PressRecording& r,
                           std::span<const int> rows) {
  const auto [least, most] = std::ranges::minmax(r.depth);
  if (name == kZero && !(most > least)) return "all rows have one depth";
  if (name == kZero && rows.size() < 2) return "one row is fitted";
  if (name == kRelaxation && r.time.empty()) return "the recording has no times";
  if ((name == kShear || name == kFriction) && r.shear.empty()) return "nothing is sheared";
  return "";
}

/// Splits what is fitted into numbers of the normal and of the shear force.
void choose_numbers(const CalibrationRequest& request, const PressRecording& recording,
                    std::span<const int> rows, std::vector<std::string>& normal,
                    std::vector<std::string>& shear, Calibration& out) {
  std::vector<std::string> known;
  for (const char* const name : {"modulus", "kn"})
    if (request.start.contains(name)) known.emplace_back(name);
  known.push_back(kZero);
  for (const std::string& name : {kRelaxation, kShear, kFriction})
    if (request.start.contains(name)) known.push_back(name);
  for (const std::string& name : request.numbers)
    if (std::ranges::count(known, name) == 0)
      throw InputError(
          fmt::format("'{}' cannot be fitted; expected some of {}", name, fmt::join(known, ", ")));
  for (const std::string& name : known) {
    const bool wanted = std::ranges::count(request.numbers, name) > 0;
    if (!request.numbers.empty() && !wanted) continue;
    if (const std::string reason = reason_against(name, recording, rows); !reason.empty()) {
      if (wanted) throw InputError(fmt::format("'{}' cannot be fitted: {}", name, reason));
      out.untold.push_back({name, reason});
    } else {
      (name == kShear || name == kFriction ? shear : normal).push_back(name);
    }
  }
}

std::vector<double> shifted(std::span<const double> depth, double zero) {
  std::vector<double> out(depth.begin(), depth.end());
  for (double& d : out) d += zero;
  return out;
}

/// Returns the factor of the computed forces that fits best; not finite where all are 0.
double best_factor(std::span<const double> computed, std::span<const double> recorded) {
  double both = 0, square = 0;
  for (std::size_t k = 0; k < computed.size(); ++k)
    both += computed[k] * recorded[k], square += computed[k] * computed[k];
  return both / square;
}

/// Scales the stiffness at the start so that the forces have the recorded size.
void scale_start(std::span<const double> computed, std::span<const double> recorded,
                 SkinAttributes& start) {
  const double factor = best_factor(computed, recorded);
  if (!std::isfinite(factor))
    throw InputError(
        "the sensor feels nothing at any depth of the recording; expected depths in m, positive "
        "into the skin, and a layout whose skin faces z");
  if (!(factor > 0))
    throw InputError("forces against the press; expected forces that are positive in compression");
  for (const char* const name : {"modulus", "kn"})
    if (start.contains(name)) start[name] *= factor;
}

/// Chooses a friction that some row exceeds and a spring that reaches it, because the fit does not
/// move a friction at which nothing slips.
void scale_shear_start(const Forces& shear, const SkinAttributes& fixed,
                       std::span<const double> normal, std::span<const double> recorded,
                       SkinAttributes& start) {
  double ratio = 0;
  for (std::size_t k = 0; k < normal.size(); ++k)
    if (normal[k] > 0) ratio = std::max(ratio, std::abs(recorded[k]) / normal[k]);
  if (!(ratio > 0)) return;
  SkinAttributes stuck = fixed;
  stuck[kShear] = start.at(kShear);
  stuck[kFriction] = kStuck * ratio;
  const double factor = best_factor(shear(stuck, 0), recorded);
  if (factor > 0 && std::isfinite(factor)) start[kShear] *= kStiffStart * factor;
  start[kFriction] = kSlipStart * ratio;
}

}  // namespace

SkinAttributes Calibration::attributes() const {
  SkinAttributes out;
  for (const FittedNumber& number : numbers)
    if (number.name != kZero) out[number.name] = number.value;
  return out;
}

std::vector<int> held_out_rows(double hold_out, int rows) {
  const double share = hold_out < 1 ? hold_out : hold_out / rows;
  std::vector<int> out;
  for (int row = 0; row < rows; ++row)
    if (std::floor((row + 1) * share + 1e-9) > std::floor(row * share + 1e-9)) out.push_back(row);
  if (std::ssize(out) >= rows)
    throw InputError(
        fmt::format("{} of {} rows are held out; expected one to fit at least", out.size(), rows));
  return out;
}

Calibration calibrate(const CalibrationRequest& request, const PressRecording& recording) {
  check(recording);
  Calibration out;
  out.held_out = held_out_rows(request.hold_out, int(recording.rows()));
  std::vector<int> rows;
  for (int row = 0; row < int(recording.rows()); ++row)
    if (!std::ranges::binary_search(out.held_out, row)) rows.push_back(row);
  std::vector<std::string> normal, shear;
  choose_numbers(request, recording, rows, normal, shear, out);

  const std::vector<double> rates = recording.rates();
  const auto press = [&](const SkinAttributes& attributes, double zero) {
    return press_forces(request.scene(attributes), shifted(recording.depth, zero), rates);
  };
  SkinAttributes start = request.start;
  if (!normal.empty() && start.contains(normal.front()) && normal.front() != kRelaxation)
    scale_start(press({}, 0), recording.force, start);
  const double depth = *std::ranges::max_element(recording.depth);
  Fit along(press, recording.force, rows, depth);
  along.run(normal, start, {}, out);
  out.force = along.computed();
  out.normal = error_of(out.force, recording.force, rows);
  out.normal_held_out = error_of(out.force, recording.force, out.held_out);
  if (shear.empty()) return out;

  double zero = 0;
  for (const FittedNumber& number : out.numbers)
    if (number.name == kZero) zero = number.value;
  const std::vector<double> depths = shifted(recording.depth, zero);
  const auto path = [&](const SkinAttributes& attributes, double) {
    return shear_forces(request.scene(attributes), depths, recording.shear);
  };
  if (shear.size() == 2)
    scale_shear_start(path, out.attributes(), out.force, recording.shear_force, start);
  Fit across(path, recording.shear_force, rows, depth);
  across.run(shear, start, out.attributes(), out);
  out.shear_force = across.computed();
  out.shear = error_of(out.shear_force, recording.shear_force, rows);
  out.shear_held_out = error_of(out.shear_force, recording.shear_force, out.held_out);
  return out;
}

}  // namespace tangere
