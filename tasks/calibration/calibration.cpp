// SPDX-License-Identifier: Apache-2.0
// The normal force is fitted without friction, then the shear force, and from there both together.
#include "tasks/calibration/calibration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <tuple>

#include "engine/base/error.hpp"
#include "tasks/calibration/depth_errors.hpp"
#include "tasks/calibration/press_error.hpp"
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
constexpr int kFrictionPasses = 5;  // each is a twentieth to a tenth as far off
constexpr int kWeightPasses = 2, kErrorPasses = 4;
constexpr double kMostWeight = 30, kLittleWeight = 1.4;  // of forces along the skin
constexpr double kUnlike = 0.3;                          // correlation of forces that have one sign
constexpr double kSliderStart = 0.1;                     // of the peak

const std::string kDepth = "table_depth";

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
  const double factor = best_factor(normal_forces(request.scene, r, straight), r.normal());
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

/// Chooses a friction that some row exceeds and a spring that reaches it, because the fit does not
/// move a friction at which nothing slips. `ratio`: the largest of shear to normal force.
void scale_shear_start(const Forces& shear, const std::vector<std::string>& names,
                       const SkinNumbers& fixed, double ratio, std::span<const double> recorded,
                       const SlipStart& slip, SkinNumbers& start) {
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

/// Whether a recording is of a shear, with forces along the skin.
bool is_sheared(const PressRecording& r) { return varies(r.shear) && !r.tangential().empty(); }

/// Whether normal forces are computed with the friction of the sensor: if the request says so, and
/// of a shear, where presses are in one place and the sensor has friction.
bool has_friction(const CalibrationRequest& request, const PressRecording& r,
                  const SkinNumbers& numbers) {
  const Scene scene = request.scene(numbers);
  const ContactCoefficients& c = scene.sensors.at(0).coefficients;
  const bool placed = varies(r.x) || varies(r.y), can = c.mu > 0 && c.ks > 0 && !placed;
  if (request.friction && !can)
    throw InputError(fmt::format(
        "a fit with friction, of {} with mu = {} and ks = {}; expected presses in one place, and "
        "mu and ks above 0",
        placed ? "presses at several places" : "a sensor", c.mu, c.ks));
  return can;
}

/// Computes the normal forces with all that the request has.
std::vector<double> all_forces(const CalibrationRequest& request, const PressRecording& r,
                               const SkinNumbers& numbers) {
  if ((request.friction || is_sheared(r)) && has_friction(request, r, numbers))
    return sheared_forces(request.scene, r, numbers).normal;
  return normal_forces(request.scene, r, numbers);
}

/// Finds what friction does, or would do where the fit is without it.
FrictionShare friction_share(const CalibrationRequest& request, const PressRecording& r,
                             const ForceFit& fit, const SkinNumbers& found) {
  FrictionShare out;
  const bool pressures = r.points > 0 && r.shear_field.empty();  // alone: without friction
  if ((pressures && !request.friction) || !has_friction(request, r, found)) return out;
  std::vector<double> share;
  try {
    share = friction_added(request.scene, r, found);
  } catch (const InputError&) {  // a step of the path failed: nothing is known
    return out;
  }
  out.mu = request.scene(found).sensors.at(0).coefficients.mu;
  out.largest = peak_of(share) / peak_of(r.normal());
  if (!request.friction && !is_sheared(r)) out.moved = fit.moves(share);
  return out;
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

/// What is fitted, and to what.
struct Problem {
  const CalibrationRequest& request;
  const PressRecording& recording;
  const Names& names;
  const std::vector<int>& rows;
  SkinNumbers start;
  double depth;  ///< the largest [m]

  /// Adds what follows from other numbers.
  [[nodiscard]] SkinNumbers full(SkinNumbers numbers) const {
    if (request.knots > 0) numbers[kDepth] = table_depth(depth, numbers);
    return numbers;
  }
  [[nodiscard]] FitRows normal_rows() const {
    return {.rows = rows, .width = normal_width(recording), .alike = recording.points > 0};
  }
};

/// A fit that can be repeated with errors of the depth.
struct FitTask {
  ShiftedForces forces;
  std::vector<double> recorded;
  FitRows rows;
  std::vector<std::string> names, held;
  FitStart start;
  SkinNumbers fixed;

  [[nodiscard]] std::vector<double> unmoved(const SkinNumbers& numbers) const {
    return forces(numbers, std::array{DepthShift{}})[0];
  }
  /// Fits without errors of the depth. The fit refers to this task.
  [[nodiscard]] ForceFit fit(const Problem& of) const {
    const auto plain = [this](const SkinNumbers& numbers) { return unmoved(numbers); };
    ForceFit out(plain, recorded, rows, of.depth, of.request.knots);
    out.run(names, start, fixed, held);
    return out;
  }
};

/// The fit of the normal forces. `sticking`: what friction adds at all rows [N], or empty.
FitTask normal_task(const Problem& of, std::vector<double> sticking) {
  const auto forces = [&of, sticking = std::move(sticking)](const SkinNumbers& numbers,
                                                            std::span<const DepthShift> shifts) {
    std::vector<std::vector<double>> out =
        shifted_forces(of.request.scene, of.recording, of.full(numbers), shifts);
    for (std::vector<double>& row : out)
      for (std::size_t k = 0; k < sticking.size(); ++k) row[k] += sticking[k];
    return out;
  };
  return {
      forces, of.recording.normal(), of.normal_rows(), of.names.normal, of.names.held, {of.start},
      {}};
}

/// Fits the normal forces, with friction of the sensor where `sticks`.
ForceFit fit_normal(const Problem& of, bool sticks, FitTask& task) {
  task = normal_task(of, {});
  ForceFit out = task.fit(of);
  for (int pass = 0; sticks && !of.names.normal.empty() && pass < kFrictionPasses; ++pass) {
    const SkinNumbers numbers = of.full(out.found());
    if (!has_friction(of.request, of.recording, numbers)) break;
    task = normal_task(of, friction_added(of.request.scene, of.recording, numbers));
    out = task.fit(of);
  }
  return out;
}

/// Puts the forces of each row together: those along the normal, then those along the skin.
std::vector<double> in_rows(std::span<const double> normal, std::span<const double> tangential,
                            const PressRecording& r) {
  const std::size_t a = normal_width(r), b = shear_width(r);
  std::vector<double> out;
  for (std::size_t row = 0; row < r.rows(); ++row) {
    for (std::size_t k = row * a; k < (row + 1) * a; ++k) out.push_back(normal[k]);
    for (std::size_t k = row * b; k < (row + 1) * b; ++k) out.push_back(tangential[k]);
  }
  return out;
}

/// Computes the forces of all rows along both directions. A rate moves what slips with the normal
/// force.
std::vector<double> joint_forces(const Problem& of, const SkinNumbers& numbers,
                                 const DepthShift& shift) {
  const PressRecording& r = of.recording;
  const SkinNumbers full = of.full(numbers);
  PathForces f = sheared_forces(of.request.scene, r, full, shift);
  if (shift.rate != 0) {
    const DepthShift still{.depth = shift.depth, .rows = shift.rows};
    const auto both = shifted_forces(of.request.scene, r, full, std::array{shift, still});
    const std::vector<double>&faster = both[0], &same = both[1];
    for (std::size_t k = 0; k < same.size(); ++k) {
      if (f.normal[k] > 0 && f.tangential.size() == same.size())
        f.tangential[k] *= 1 + (faster[k] - same[k]) / f.normal[k];
      f.normal[k] += faster[k] - same[k];
    }
  }
  return in_rows(f.normal, f.tangential, r);
}

/// Fits ks and mu to the forces along the skin from several starts, of which the best end counts.
/// `numbers`: of the normal forces.
ForceFit fit_shear(const Problem& of, const SkinNumbers& numbers, bool slips) {
  const PressRecording& r = of.recording;
  const std::vector<double>& recorded = r.tangential();
  const FitRows rows{.rows = of.rows, .width = shear_width(r), .alike = r.points > 0};
  const double ratio = largest_ratio(r);
  const auto path = [&of](const SkinNumbers& chosen) {
    return sheared_forces(of.request.scene, of.recording, of.full(chosen)).tangential;
  };
  const auto fit_from = [&](const std::optional<SlipStart>& slip) {
    SkinNumbers at = of.start;
    if (slip) scale_shear_start(path, of.names.shear, numbers, ratio, recorded, *slip, at);
    SkinNumbers begin = numbers;
    for (const std::string& name : of.names.shear) begin[name] = at.at(name);  // none: a score
    check_shear_sign(path, begin, recorded);
    ForceFit fit(path, recorded, rows, of.depth, 0);
    fit.run(of.names.shear, {at}, numbers);
    return std::pair{error_of(path(fit.found()), recorded, of.rows, rows.width).root_mean_square,
                     fit};
  };
  auto [least, across] = fit_from(slips ? std::optional(kSlipStarts[0]) : std::nullopt);
  for (std::size_t k = 1; slips && k < std::size(kSlipStarts); ++k)
    if (auto [error, fit] = fit_from(kSlipStarts[k]); error < least) least = error, across = fit;
  return across;
}

/// Fits the forces along both directions, from the fits of each. They count by their own errors.
ForceFit fit_jointly(const Problem& of, const ForceFit& along, const ForceFit& across,
                     FitTask& task) {
  const PressRecording& r = of.recording;
  const std::size_t width = normal_width(r);
  task.forces = [&of](const SkinNumbers& numbers, std::span<const DepthShift> shifts) {
    std::vector<std::vector<double>> out;
    for (const DepthShift& shift : shifts) out.push_back(joint_forces(of, numbers, shift));
    return out;
  };
  task.recorded = in_rows(r.normal(), r.tangential(), r);
  task.rows.width = width + shear_width(r);
  task.rows.normal = width;
  task.names = along.names();
  task.start.at = task.fixed = across.found();
  task.names.insert(task.names.end(), across.names().begin(), across.names().end());
  task.start.settled = task.names;
  std::erase(task.start.settled, kRelaxation);
  const bool untold = std::ranges::count(along.untold(), kRelaxation, &UntoldNumber::name) > 0;
  if (untold) task.names.emplace_back(kRelaxation);  // which a shear may tell
  for (const std::string& name : task.names) task.fixed.erase(name);
  ForceFit out = task.fit(of);
  for (int pass = 0; pass < kWeightPasses; ++pass) {
    const auto [normal, tangential] = out.force_errors();
    if (!(normal > 0 && tangential > 0)) break;
    const double weight = std::clamp(normal / tangential, 1 / kMostWeight, kMostWeight),
                 change = weight / task.rows.weight;
    if (change < kLittleWeight && change > 1 / kLittleWeight) break;
    task.rows.weight = weight;
    task.start.at = out.found();
    out = task.fit(of);
  }
  return out;
}

/// Repeats a fit with errors of the depth, if there are any.
void add_depth_errors(const Problem& of, const FitTask& task, ForceFit& fit, Calibration& out) {
  const PressRecording& r = of.recording;
  if (r.points > 0 && of.request.depth_error.value_or(0) > 0)
    throw InputError(
        "errors of the depth of a field; expected none: its intervals are also those of errors of "
        "whole rows, which contain them");
  const double deviation = of.request.depth_error.value_or(r.points > 0 ? 0 : r.depth_scatter());
  if (fit.names().empty() || !(deviation > 0)) return;
  const SkinNumbers found = fit.found();
  const bool rates = of.request.start.contains(kRelaxation);
  const auto errors = std::make_shared<DepthErrors>(task.forces, r, task.rows, deviation, rates);
  std::vector<double> off = task.unmoved(found);
  for (std::size_t k = 0; k < off.size(); ++k) off[k] -= task.recorded[k];
  const bool estimated = !of.request.depth_error;
  if (estimated && !(told_depth_error(*errors, r, found, off) > 0)) return;
  const std::array<double, 2> deviations = fit.force_errors();
  out.depth_error = {deviation, estimated};
  FitStart start = task.start;
  for (int pass = 0; pass < kErrorPasses; ++pass) {
    start.at = fit.found();
    off = errors->forces(start.at);
    for (std::size_t k = 0; k < off.size(); ++k) off[k] -= task.recorded[k];
    errors->choose_errors(start.at, off, deviations);
    ForceFit next([errors](const SkinNumbers& numbers) { return errors->forces(numbers); },
                  task.recorded, task.rows, of.depth, of.request.knots,
                  [errors](const SkinNumbers& numbers, const std::vector<double>& left) {
                    return errors->whitened(numbers, left);
                  });
    next.run(fit.names(), start, task.fixed, task.held);
    fit = next;
  }
}

/// Finds how far the forces along the skin are off.
void add_shear_errors(const Problem& of, Calibration& out) {
  const std::vector<double> shear =
      sheared_forces(of.request.scene, of.recording, out.found).tangential;
  const std::vector<double>& recorded = of.recording.tangential();
  out.shear = error_of(shear, recorded, out.rows, shear_width(of.recording));
  out.shear_held_out = error_of(shear, recorded, out.held_out, shear_width(of.recording));
}

/// Fits all numbers.
void fit_all(const Problem& of, Calibration& out) {
  const PressRecording& r = of.recording;
  const bool sheared =
      !of.names.shear.empty() || (!of.request.fit && !r.shear.empty() && !r.tangential().empty());
  const bool jointly = !of.names.shear.empty() && !of.names.normal.empty();
  FitTask task;
  ForceFit fit = fit_normal(of, !jointly && (of.request.friction || is_sheared(r)), task);
  std::vector<UntoldNumber> untold = fit.untold();
  out.converged = fit.converged();
  if (jointly) {
    const bool slips = std::ranges::count(of.names.shear, kFriction) > 0;
    const ForceFit across = fit_shear(of, fit.found(), slips);
    untold.insert(untold.end(), across.untold().begin(), across.untold().end());
    fit = fit_jointly(of, fit, across, task);
    std::erase_if(untold, [&](const UntoldNumber& number) {
      return std::ranges::count(fit.names(), number.name) > 0;
    });
    for (const UntoldNumber& number : fit.untold())
      if (std::ranges::count(untold, number.name, &UntoldNumber::name) == 0)
        untold.push_back(number);
  }
  add_depth_errors(of, task, fit, out);
  add_given(fit, of.names, !of.request.numbers.empty(), r.points > 0, out);
  add_fit(fit, out);
  out.untold.insert(out.untold.end(), untold.begin(), untold.end());
  out.zero_correlation = fit.correlation(kZero, kForceZero);
  if (of.request.knots > 0) out.found[kDepth] = table_depth(of.depth, out.found);
  if (sheared && !jointly) {  // of a stiffness that is not fitted
    const bool slips = std::ranges::count(of.names.shear, kFriction) > 0;
    const ForceFit across = fit_shear(of, out.found, slips);
    add_fit(across, out);
    out.untold.insert(out.untold.end(), across.untold().begin(), across.untold().end());
  }
  if (std::ranges::count(out.untold, kFriction, &UntoldNumber::name) > 0 &&
      number_or(out.found, kFriction, 0) > 0)
    out.least_friction = largest_ratio(r);
  if (sheared) add_shear_errors(of, out);
  if (!of.names.normal.empty()) out.friction = friction_share(of.request, r, fit, out.found);
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
  check_recording(recording);
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
  fit_all({request, recording, names, rows, start, depth}, out);
  out.rows_above = rows_above(acting_depths(recording, out.found), rows);
  const std::vector<double> normal = all_forces(request, recording, out.found);
  const std::vector<double>& force = recording.normal();
  out.normal = error_of(normal, force, rows, normal_width(recording));
  out.normal_held_out = error_of(normal, force, out.held_out, normal_width(recording));
  return out;
}

PressError check_calibration(const CalibrationRequest& request, const SkinNumbers& found,
                             const PressRecording& recording, std::vector<int> rows) {
  check_recording(recording);
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
