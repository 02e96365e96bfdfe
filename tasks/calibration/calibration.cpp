// SPDX-License-Identifier: Apache-2.0
// Two fits, of the normal and then of the shear force. A slider beside the skin has at the depths
// d > 0 of a path the force s' = clamp(s + k (d' - d), ±F), and 0 outside.
#include "tasks/calibration/calibration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <tuple>

#include "engine/base/error.hpp"
#include "tasks/calibration/press_warnings.hpp"

namespace tangere {
namespace {

constexpr double kStuck = 1e3;  // of the largest ratio of shear to normal force
/// Where fits of a shear begin: the friction, of that ratio, and the spring, of the one that fits
/// without slip. All points slip at the first, those at the rim then, and hardly any at the last.
struct SlipStart {
  double friction, stiffness;
};
constexpr SlipStart kSlipStarts[] = {{0.9, 3}, {1.2, 1.5}, {1.6, 1.2}, {2.2, 1.1}, {4, 1.02}};
constexpr int kFrictionPasses = 5;    // each is a twentieth to a tenth as far off
constexpr double kUnlike = 0.3;       // correlation of forces that have one sign
constexpr double kSliderStart = 0.1;  // of the peak
constexpr double kSmallest = 0.05;    // of the peak: smaller forces have no error of their own

const std::string kDepth = "table_depth";

double number_or(const SkinNumbers& numbers, const std::string& name, double otherwise) {
  const auto at = numbers.find(name);
  return at == numbers.end() ? otherwise : at->second;
}

double peak_of(std::span<const double> force) {
  double peak = 0;
  for (const double f : force) peak = std::max(peak, std::abs(f));
  return peak;
}

/// `width`: numbers of a row.
PressError error_of(std::span<const double> computed, std::span<const double> recorded,
                    std::span<const int> rows, std::size_t width) {
  PressError out;
  const double peak = peak_of(recorded);
  double recorded_squares = 0;
  for (const int row : rows) {
    double own = 0, squares = 0, off_squares = 0;
    for (std::size_t k = width * std::size_t(row); k < width * (std::size_t(row) + 1); ++k) {
      const double f = recorded[k], off = std::abs(computed[k] - f);
      own = std::max(own, std::abs(f));
      squares += f * f, off_squares += off * off;
      out.largest = std::max(out.largest, off / peak);
    }
    out.root_mean_square += off_squares, recorded_squares += squares;
    if (own > kSmallest * peak)
      out.largest_by_row = std::max(out.largest_by_row, std::sqrt(off_squares / squares));
  }
  out.rows = int(rows.size());
  if (recorded_squares > 0) out.relative = std::sqrt(out.root_mean_square / recorded_squares);
  if (out.rows > 0)
    out.root_mean_square =
        std::sqrt(out.root_mean_square / (double(out.rows) * double(width))) / peak;
  return out;
}

/// Numbers of a row of the normal and of the tangential forces.
std::size_t normal_width(const PressRecording& r) { return std::max<std::size_t>(r.points, 1); }
std::size_t shear_width(const PressRecording& r) { return std::max<std::size_t>(2 * r.points, 1); }

void check_columns(const PressRecording& r) {
  const bool fields = r.points > 0;
  for (const auto& [name, column, width] :
       {std::tuple{"force", &r.force, std::size_t{1}},
        {"time", &r.time, 1},
        {"shear", &r.shear, 1},
        {"shear force", &r.shear_force, 1},
        {"x", &r.x, 1},
        {"y", &r.y, 1},
        {"the field", &r.field, r.points},
        {"the field along the skin", &r.shear_field, 2 * r.points}}) {
    const bool needed = column == (fields ? &r.field : &r.force);
    if (column->size() != width * r.rows() && (!column->empty() || needed))
      throw InputError(fmt::format("a recording of {} depths and {} numbers of {}; expected {}",
                                   r.rows(), column->size(), name,
                                   width == 1 ? "as many" : "as many for each point"));
  }
}

void check(const PressRecording& r) {
  if (r.rows() == 0) throw InputError("a recording without depths; expected one row at least");
  check_columns(r);
  if (r.points == 0 && r.shear.empty() != r.shear_force.empty())
    throw InputError("shear without its force, or the force without it; expected both or none");
  if (r.points == 0 && !(r.x.empty() && r.y.empty()))
    throw InputError("x or y without a field; expected a press in the middle of the skin");
  if (!r.shear.empty() && !(r.x.empty() && r.y.empty()))
    throw InputError("x or y beside a shear; expected presses at places, or a path");
  for (std::size_t k = 1; k < r.time.size(); ++k)
    if (!(r.time[k] > r.time[k - 1]))
      throw InputError(fmt::format("row {}: time {} s after {} s; expected ascending times", k + 1,
                                   r.time[k], r.time[k - 1]));
  if (!(peak_of(r.normal()) > 0))
    throw InputError("a recording without any force; expected a press of the skin");
}

bool varies(std::span<const double> column) {
  return std::ranges::adjacent_find(column, std::ranges::not_equal_to()) != column.end();
}

/// Why the columns cannot tell a number; "" if they may.
std::string reason_against(const std::string& name, const PressRecording& r, std::size_t rows) {
  if ((name == kZero || name == kForceZero || name == kSlider || name == kTable) &&
      !varies(r.depth))
    return "all rows have one depth";
  if ((name == kZero || name == kForceZero) && rows < 2) return "one row is fitted";
  if ((name == kRelaxation || name == kLag) && r.time.empty()) return "the recording has no times";
  if ((name == kRelaxation || name == kLag) && r.rows() < 2) return "the recording has one row";
  if ((name == kShear || name == kFriction) && !varies(r.shear)) return "nothing is sheared";
  if ((name == kShear || name == kFriction) && r.tangential().empty())
    return "the field has no forces along the skin";
  return "";
}

struct Names {
  std::vector<std::string> normal, shear;
  std::vector<std::string> held;  ///< usual ones that the normal forces do not tell
};

int rows_above(std::span<const double> depth, std::span<const int> rows) {
  return int(std::ranges::count_if(rows, [&](int row) { return depth[std::size_t(row)] < 0; }));
}

/// Chooses what is fitted, by normal and by shear forces. `rows`: those that are fitted.
Names choose_numbers(const CalibrationRequest& request, const PressRecording& recording,
                     std::span<const int> rows, std::vector<UntoldNumber>& untold) {
  std::vector<std::string> usual, known;
  for (const char* const name : {"modulus", "kn"})
    if (request.start.contains(name) && request.knots == 0) usual.emplace_back(name);
  usual.emplace_back(request.knots > 0 ? kTable : kZero);
  for (const char* const name : {kRelaxation, kShear, kFriction})
    if (request.start.contains(name)) usual.emplace_back(name);
  const bool fields = recording.points > 0;
  if (fields) usual.insert(usual.end(), {kPlaceX, kPlaceY});
  if (!fields && rows_above(recording.depth, rows) > 0) usual.emplace_back(kForceZero);
  known = usual;
  for (const char* const name : {kZero, kForceZero, kLag, kSlider}) {
    const bool alone = name == kForceZero || name == kSlider;  // of a load cell
    if (!(fields && alone) && std::ranges::count(known, name) == 0) known.emplace_back(name);
  }
  for (const std::string& name : request.numbers)
    if (std::ranges::count(known, name) == 0)
      throw InputError(
          fmt::format("'{}' cannot be fitted; expected some of {}", name, fmt::join(known, ", ")));
  Names out;
  if (!request.fit && request.numbers.empty()) return out;
  for (const std::string& name : request.numbers.empty() ? usual : known) {
    const bool requested = std::ranges::count(request.numbers, name) > 0;
    if (!request.numbers.empty() && !requested) continue;
    if (const std::string reason = reason_against(name, recording, rows.size()); !reason.empty()) {
      if (requested) throw InputError(fmt::format("'{}' cannot be fitted: {}", name, reason));
      untold.push_back({name, reason});
      if (name == kZero || name == kForceZero) out.held.push_back(name);
      continue;
    }
    auto& list = name == kShear || name == kFriction ? out.shear : out.normal;
    list.push_back(name);
    if (name == kSlider) list.emplace_back(kSliderForce);
  }
  if (request.knots > 0 && std::ranges::count(out.normal, kTable) == 0)
    throw InputError(
        "a table without 'pressure' among the fitted numbers, or with one depth alone");
  return out;
}

/// The depths that act at the rows: those of `lag` earlier, and nearer by the zero.
std::vector<double> acting_depths(const PressRecording& r, const SkinNumbers& numbers) {
  const double lag = number_or(numbers, kLag, 0), zero = number_or(numbers, kZero, 0);
  std::vector<double> out = r.depth;
  for (std::size_t row = 0; row < r.rows() && r.rows() > 1 && lag > 0; ++row) {
    const double then = std::max(r.time[row] - lag, r.time[0]);
    const auto after = std::upper_bound(r.time.begin() + 1, r.time.end() - 1, then);
    const auto k = std::size_t(after - r.time.begin());
    out[row] = r.depth[k - 1] +
               (r.depth[k] - r.depth[k - 1]) * (then - r.time[k - 1]) / (r.time[k] - r.time[k - 1]);
  }
  for (double& d : out) d += zero;
  return out;
}

/// The rows of a recording as they act, with the numbers of the recording.
class Acting {
 public:
  Acting(const PressRecording& r, const SkinNumbers& numbers)
      : time_(r.time), depth_(acting_depths(r, numbers)), fields_(r.points > 0) {
    PressRecording moved;
    moved.time = r.time, moved.depth = depth_;
    rate_ = moved.rates();
    const double dx = number_or(numbers, kPlaceX, 0), dy = number_or(numbers, kPlaceY, 0);
    x_ = r.shear.empty() ? r.x : r.shear, y_ = r.y;
    if (dx != 0) x_.resize(r.rows());
    if (dy != 0) y_.resize(r.rows());
    for (double& x : x_) x += dx;
    for (double& y : y_) y += dy;
  }

  /// Of presses without friction. A sum does not depend on where the indenter went by shear.
  [[nodiscard]] PressPath normal() const {
    PressPath path = whole();
    if (!fields_) path.x = path.y = {};
    return path;
  }
  [[nodiscard]] PressPath whole() const {
    return {.depth = depth_, .rate = rate_, .time = time_, .x = x_, .y = y_, .fields = fields_};
  }
  [[nodiscard]] std::span<const double> depth() const { return depth_; }

 private:
  std::vector<double> time_, depth_, rate_, x_, y_;
  bool fields_;
};

/// Adds the slider, if there is one. The indenter does not pull.
void add_slider(std::span<const double> depth, const SkinNumbers& numbers,
                std::vector<double>& force) {
  const double stiffness = number_or(numbers, kSlider, 0);
  if (stiffness == 0) return;
  const double most = numbers.at(kSliderForce);
  double s = 0;
  for (std::size_t k = 0; k < depth.size(); ++k) {
    const double before = std::max(depth[k > 0 ? k - 1 : 0], 0.0);
    s = depth[k] > 0 ? std::clamp(s + stiffness * (depth[k] - before), -most, most) : 0;
    force[k] = std::max(force[k] + s, 0.0);
  }
}

std::vector<double> normal_forces(const CalibrationRequest& request, const PressRecording& r,
                                  const SkinNumbers& numbers) {
  const Acting acting(r, numbers);
  std::vector<double> force = press_forces(request.scene(numbers), acting.normal());
  add_slider(acting.depth(), numbers, force);
  const double offset = number_or(numbers, kForceZero, 0);
  if (offset != 0)
    for (double& f : force) f += offset;
  return force;
}

/// Returns the factor of the computed forces that fits best; not finite where all are 0.
double best_factor(std::span<const double> computed, std::span<const double> recorded) {
  double both = 0, square = 0;
  for (std::size_t k = 0; k < computed.size(); ++k)
    both += computed[k] * recorded[k], square += computed[k] * computed[k];
  return both / square;
}

/// Returns the last depth of a table [m]. On its way a fit may try zeros beyond all depths.
double table_depth(double deepest, const SkinNumbers& numbers) {
  constexpr double kShallowest = 0.01;
  return std::max(deepest + number_or(numbers, kZero, 0), kShallowest * deepest);
}

/// Chooses stiffness or table, and slider, so that forces have the recorded size.
void scale_start(const CalibrationRequest& request, const PressRecording& r, double depth,
                 SkinNumbers& start) {
  SkinNumbers straight;
  for (int k = 1; k <= request.knots; ++k) straight[table_number(k)] = k;
  if (request.knots > 0) straight[kDepth] = depth;
  for (const char* const name : {"modulus", "kn"})
    if (start.contains(name)) straight[name] = start[name];
  const double factor = best_factor(normal_forces(request, r, straight), r.normal());
  if (const std::string reason = why_no_touch(request.scene(straight), depth);
      !std::isfinite(factor) && !reason.empty())
    throw InputError("the sensor feels nothing at any depth of the recording: " + reason +
                     "; expected a larger ball, or points that are closer");
  if (!std::isfinite(factor))
    throw InputError(
        "the sensor feels nothing at any depth of the recording; expected depths in m, positive "
        "into the skin, and a layout whose skin faces z");
  if (!(factor > 0))
    throw InputError(
        "forces against those of the press; expected forces that are positive in compression, and "
        "depths that are smaller than a ball's radius");
  for (const char* const name : {"modulus", "kn"})
    if (start.contains(name)) start[name] *= factor;
  for (int k = 1; k <= request.knots; ++k) start[table_number(k)] = factor;  // increments
  start[kSlider] = peak_of(r.normal()) / depth;
  start[kSliderForce] = kSliderStart * peak_of(r.normal());
  if (!r.time.empty()) start[kLag] = (r.time.back() - r.time.front()) / double(r.rows());
}

/// The whole forces at each row: along the normal, and the size of that along the skin.
struct RowSums {
  std::vector<double> normal, tangential;
};
RowSums row_sums(std::span<const double> normal, std::span<const double> tangential,
                 std::size_t points) {
  RowSums out;
  const std::size_t width = std::max<std::size_t>(points, 1), rows = normal.size() / width;
  for (std::size_t row = 0; row < rows; ++row) {
    double sum = 0, a = 0, b = 0;
    for (std::size_t k = row * width; k < (row + 1) * width; ++k) {
      sum += normal[k];
      if (points == 0)
        a += tangential[k];
      else
        a += tangential[2 * k], b += tangential[2 * k + 1];
    }
    out.normal.push_back(sum), out.tangential.push_back(std::hypot(a, b));
  }
  return out;
}

/// Chooses a friction that some row exceeds and a spring that reaches it, because the fit does not
/// move a friction at which nothing slips.
void scale_shear_start(const Forces& shear, const std::vector<std::string>& names,
                       const SkinNumbers& fixed, const RowSums& sums,
                       std::span<const double> recorded, const SlipStart& slip,
                       SkinNumbers& start) {
  double ratio = 0;
  for (std::size_t k = 0; k < sums.normal.size(); ++k)
    if (sums.normal[k] > 0) ratio = std::max(ratio, sums.tangential[k] / sums.normal[k]);
  if (!(ratio > 0)) return;
  if (std::ranges::count(names, kShear) > 0) {
    SkinNumbers stuck = fixed;
    stuck[kShear] = start.at(kShear);
    stuck[kFriction] = kStuck * ratio;
    const double factor = best_factor(shear(stuck), recorded);
    if (factor > 0 && std::isfinite(factor)) start[kShear] *= slip.stiffness * factor;
  }
  start[kFriction] = slip.friction * ratio;
}

/// Refuses a shear force whose sign is that of the indenter's other side.
void check_shear_sign(const Forces& shear, const SkinNumbers& numbers,
                      std::span<const double> recorded) {
  const std::vector<double> computed = shear(numbers);
  double both = 0, squares = 0, recorded_squares = 0;
  for (std::size_t k = 0; k < computed.size(); ++k) {
    both += computed[k] * recorded[k];
    squares += computed[k] * computed[k], recorded_squares += recorded[k] * recorded[k];
  }
  const double alike = both / std::sqrt(squares * recorded_squares);
  if (alike < -kUnlike)
    throw InputError(
        fmt::format("shear_force against the shear: its correlation with the computed force is "
                    "{:.2f}; expected the force of the indenter on the skin, which has the sign of "
                    "the shear: multiply shear_force or shear by -1",
                    alike));
}

/// Returns what friction adds at all rows; empty if the sensor has none, or if rows are at several
/// places.
std::vector<double> friction_forces(const CalibrationRequest& request, const PressRecording& r,
                                    const SkinNumbers& numbers) {
  const Scene scene = request.scene(numbers);
  const ContactCoefficients& c = scene.sensors.at(0).coefficients;
  const bool sheared = varies(r.shear), placed = varies(r.x) || varies(r.y);
  if (!(c.mu > 0) || !(c.ks > 0) || placed || (sheared && request.friction)) {
    if (!request.friction) return {};
    throw InputError(fmt::format(
        "a fit with friction, of {} with mu = {} and ks = {}; expected presses in one place, "
        "without shear, and mu and ks above 0",
        sheared  ? "a shear"
        : placed ? "presses at several places"
                 : "a sensor",
        c.mu, c.ks));
  }
  try {
    const Acting acting(r, numbers);
    return friction_shares(scene, acting.whole());
  } catch (const InputError&) {  // a step of the path failed: nothing is known
    if (request.friction) throw;
    return {};
  }
}

/// Computes the forces with all that the request has.
std::vector<double> all_forces(const CalibrationRequest& request, const PressRecording& r,
                               const SkinNumbers& numbers) {
  std::vector<double> out = normal_forces(request, r, numbers);
  if (!request.friction) return out;
  const std::vector<double> more = friction_forces(request, r, numbers);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] += more[k];
  return out;
}

/// Finds what friction does, or would do where the fit is without it.
FrictionShare friction_share(const CalibrationRequest& request, const PressRecording& r,
                             const ForceFit& along, const SkinNumbers& found) {
  FrictionShare out;
  const bool pressures = r.points > 0 && r.shear_field.empty();  // alone: without friction
  if (pressures && !request.friction) return out;
  const std::vector<double> share = friction_forces(request, r, found);
  if (share.empty()) return out;
  out.mu = request.scene(found).sensors.at(0).coefficients.mu;
  out.largest = peak_of(share) / peak_of(r.normal());
  if (!request.friction) out.moved = along.moves(share);
  return out;
}

/// Returns the largest ratio of shear to normal force, of rows whose normal force counts.
double largest_ratio(const PressRecording& r) {
  const RowSums sums = row_sums(r.normal(), r.tangential(), r.points);
  const double least = kSmallest * peak_of(sums.normal);
  double ratio = 0;
  for (std::size_t k = 0; k < r.rows(); ++k)
    if (sums.normal[k] > least) ratio = std::max(ratio, sums.tangential[k] / sums.normal[k]);
  return ratio;
}

/// Finds what the zeros that are not fitted do. Those that nothing tells widen the intervals,
/// unless the user chose the numbers.
void add_given(ForceFit& fit, const Names& names, bool chosen, bool fields, Calibration& out) {
  for (const char* const zero : {kZero, kForceZero}) {
    if (fields && zero == kForceZero) continue;  // of a load cell
    if (names.normal.empty() || std::ranges::count(names.normal, zero) > 0) continue;
    out.given.push_back(fit.given(zero));
    if (!out.given.back().told && !chosen) fit.hold(zero);
  }
}

/// Adds what a fit found.
void add_fit(const ForceFit& fit, Calibration& out) {
  out.found = fit.found();
  out.converged = out.converged && fit.converged();
  for (const FittedNumber& number : fit.numbers()) out.numbers.push_back(number);
  out.untold.insert(out.untold.end(), fit.untold().begin(), fit.untold().end());
}

/// Refuses a table of more numbers than forces. Of others the confidence says what is not told.
/// `width`: forces of a row.
void check_table_rows(const CalibrationRequest& request, const Names& names, std::size_t rows,
                      std::size_t width) {
  if (std::ranges::count(names.normal, kTable) == 0) return;
  const std::size_t fitted = names.normal.size() + std::size_t(request.knots) - 1;
  if (fitted > rows * width)
    throw InputError(fmt::format("{} rows{} to fit {} numbers; expected a {} for each at least",
                                 rows, width > 1 ? fmt::format(" of {} forces", width) : "", fitted,
                                 width > 1 ? "force" : "row"));
}

/// What the fit of a shear follows.
struct ShearFit {
  const CalibrationRequest& request;
  const PressRecording& recording;
  const std::vector<std::string>& names;
  const SkinNumbers& start;
  const std::vector<double>& normal;  ///< forces that were computed
  const ForceFit& along;              ///< fit of the normal forces
  std::function<SkinNumbers(SkinNumbers)> full;
};

/// Fits ks and mu from several starts, of which the best end counts.
void fit_shear(const ShearFit& of, Calibration& out) {
  const PressRecording& r = of.recording;
  const std::vector<double>& recorded = r.tangential();
  const std::size_t width = shear_width(r);
  const RowSums sums = row_sums(of.normal, recorded, r.points);
  const auto path = [&](const SkinNumbers& chosen) {
    const SkinNumbers numbers = of.full(chosen);
    const Acting acting(r, numbers);
    return shear_forces(of.request.scene(numbers), acting.whole());
  };
  const double depth = *std::ranges::max_element(r.depth);
  const auto fit_from = [&](const std::optional<SlipStart>& slip) {
    SkinNumbers at = of.start;
    if (slip) scale_shear_start(path, of.names, out.found, sums, recorded, *slip, at);
    SkinNumbers begin = out.found;
    for (const std::string& name : of.names) begin[name] = at.at(name);  // none: a score
    check_shear_sign(path, begin, recorded);
    ForceFit fit(path, recorded, {out.rows, width}, depth, 0);
    fit.run(of.names, at, out.found);
    return std::pair{error_of(path(fit.found()), recorded, out.rows, width).root_mean_square, fit};
  };
  const bool slips = std::ranges::count(of.names, kFriction) > 0;
  auto [least, across] = fit_from(slips ? std::optional(kSlipStarts[0]) : std::nullopt);
  for (std::size_t k = 1; slips && k < std::size(kSlipStarts); ++k)
    if (auto [error, fit] = fit_from(kSlipStarts[k]); error < least) least = error, across = fit;
  across.add_errors_of(of.along);
  add_fit(across, out);
  if (std::ranges::count(across.untold(), kFriction, &UntoldNumber::name) > 0 &&
      out.found.at(kFriction) > 0)
    out.least_friction = largest_ratio(r);
  const std::vector<double> shear = path(out.found);
  out.shear = error_of(shear, recorded, out.rows, width);
  out.shear_held_out = error_of(shear, recorded, out.held_out, width);
}

}  // namespace

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
  if (request.start.contains(kRelaxation)) out.turns = recording.turns();
  std::vector<int>& rows = out.rows;
  for (int row = 0; row < int(recording.rows()); ++row)
    if (!std::ranges::binary_search(out.held_out, row) &&
        !std::ranges::binary_search(out.turns, row))
      rows.push_back(row);
  const double depth = *std::ranges::max_element(recording.depth);
  if (request.knots > 0 && !(depth > 0))
    throw InputError(
        fmt::format("a table up to the depth {} m; expected depths positive into the skin", depth));
  const Names names = choose_numbers(request, recording, rows, out.untold);
  check_table_rows(request, names, rows.size(), normal_width(recording));
  if (!names.shear.empty() && !(peak_of(recording.tangential()) > 0))
    throw InputError("a shear without any force; expected shear forces, or no columns of a shear");

  SkinNumbers start = request.start;
  if (!names.normal.empty()) scale_start(request, recording, depth, start);
  const std::vector<double>& force = recording.normal();
  const std::size_t width = normal_width(recording);
  std::vector<double> sticking(force.size());  // of friction, held while the rest is fitted
  const auto full = [&](SkinNumbers numbers) {
    if (request.knots > 0) numbers[kDepth] = table_depth(depth, numbers);
    return numbers;
  };
  const auto press = [&](const SkinNumbers& numbers) {
    std::vector<double> computed = normal_forces(request, recording, full(numbers));
    for (std::size_t k = 0; k < computed.size(); ++k) computed[k] += sticking[k];
    return computed;
  };
  const FitRows fitted{rows, width};
  ForceFit along(press, force, fitted, depth, request.knots);
  along.run(names.normal, start, out.found, names.held);
  for (int pass = 0; request.friction && !names.normal.empty() && pass < kFrictionPasses; ++pass) {
    sticking = friction_forces(request, recording, full(along.found()));
    along = ForceFit(press, force, fitted, depth, request.knots);
    along.run(names.normal, start, out.found, names.held);
  }
  add_given(along, names, !request.numbers.empty(), recording.points > 0, out);
  add_fit(along, out);
  out.zero_correlation = along.correlation(kZero, kForceZero);
  if (request.knots > 0) out.found[kDepth] = table_depth(depth, out.found);
  out.rows_above = rows_above(acting_depths(recording, out.found), rows);
  const std::vector<double> normal = all_forces(request, recording, out.found);
  out.normal = error_of(normal, force, rows, width);
  out.normal_held_out = error_of(normal, force, out.held_out, width);
  const bool sheared = !names.shear.empty() || (!request.fit && !recording.shear.empty() &&
                                                !recording.tangential().empty());
  if (sheared) fit_shear({request, recording, names.shear, start, normal, along, full}, out);
  if (!names.normal.empty()) out.friction = friction_share(request, recording, along, out.found);
  return out;
}
PressError check_calibration(const CalibrationRequest& request, const SkinNumbers& found,
                             const PressRecording& recording, std::vector<int> rows) {
  check(recording);
  for (const char* const name : {kLag, kRelaxation})
    if (found.contains(name) && recording.time.empty())
      throw InputError(fmt::format(
          "the other recording has no times, and '{}' was fitted; expected times", name));
  if (rows.empty())
    for (int k = 0; k < int(recording.rows()); ++k) rows.push_back(k);
  return error_of(all_forces(request, recording, found), recording.normal(), rows,
                  normal_width(recording));
}

}  // namespace tangere
