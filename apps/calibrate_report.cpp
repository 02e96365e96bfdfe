// SPDX-License-Identifier: Apache-2.0
// Errors are shares of the largest recorded force.
#include "apps/calibrate_report.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

namespace tangere::apps {
namespace {

std::string interval_text(const FittedNumber& n) {
  if (!std::isfinite(n.high - n.low)) return "cannot be told";
  return fmt::format("{:.4g} to {:.4g}", n.low, n.high);
}

/// "modulus [Pa]", "ks [N/m³]", "pressure at 0.001 m [Pa]" …
std::string label_of(const std::string& number, const CalibrationReport& of) {
  static const std::map<std::string, const char*> kUnits = {
      {"modulus", "Pa"},   {"relaxation", "s"}, {"zero", "m"},
      {"force_zero", "N"}, {"x_zero", "m"},     {"y_zero", "m"},
      {"lag", "s"},        {"slider", "N/m"},   {"slider_force", "N"}};
  if (number == "kn" || number == "ks")
    return fmt::format("{} [{}]", number, of.per_area ? "N/m³" : "N/m");
  for (int k = 1; k <= of.knots; ++k)
    if (number == table_number(k))
      return fmt::format("pressure at {:.3g} m [Pa]",
                         of.found.found.at("table_depth") * k / of.knots);
  const auto unit = kUnits.find(number);
  return unit == kUnits.end() ? number : fmt::format("{} [{}]", number, unit->second);
}

std::string own_text(const std::string& number, const SkinNumbers& own) {
  const auto at = own.find(number);
  return at == own.end() ? "" : fmt::format("{:.4g}", at->second);
}

std::string error_text(const std::string& what, const PressError& error, std::size_t points) {
  if (error.rows == 0) return "";
  if (points > 0)
    return fmt::format(
        "{}, {} row{} of {} points: off by {} of the peak (root mean square), {} at most; {} of "
        "the "
        "norm of a row's own field at most\n",
        what, error.rows, error.rows == 1 ? "" : "s", points, percent(error.root_mean_square),
        percent(error.largest), percent(error.largest_by_row));
  return fmt::format(
      "{}, {} row{}: off by {} of the peak (root mean square), {} at most; {} of a row's own force "
      "at most\n",
      what, error.rows, error.rows == 1 ? "" : "s", percent(error.root_mean_square),
      percent(error.largest), percent(error.largest_by_row));
}

/// "taken as 0: force_zero [N]: 0.2 N, 1 % of the peak, would move kn by 2 %".
std::string given_text(const GivenNumber& given, const CalibrationReport& report) {
  if (given.told && given.moved.empty()) return "";
  const bool force = given.name == kForceZero;
  std::string text = fmt::format("taken as 0: {}", label_of(given.name, report));
  if (!given.moved.empty())
    text += fmt::format(": {:.3g} {}, 1 % of the {}, would move {} by {:+.2g} %", given.error,
                        force ? "N" : "m", force ? "peak" : "largest depth",
                        label_of(given.moved, report), 100 * given.change);
  if (!given.told)
    text += force ? "; other numbers take its place: record rows above the skin, at depths below 0"
                  : "; other numbers take its place: record several depths";
  return text + "\n";
}

/// How well the two zeros are told from each other, where they are fitted.
std::string zeros_text(const Calibration& found) {
  if (!found.zero_correlation) return "";
  constexpr double kHardly = 0.95;
  std::string text = fmt::format("force_zero is told by {} row{} above the skin", found.rows_above,
                                 found.rows_above == 1 ? "" : "s");
  if (found.rows_above == 0) text = "force_zero is told by the bend of the curve alone";
  if (std::abs(*found.zero_correlation) > kHardly)
    text += fmt::format(
        "; zero and force_zero are hardly told from each other (correlation {:.4f}): record more "
        "rows above the skin",
        *found.zero_correlation);
  return text + "\n";
}

std::string turns_text(const Calibration& found) {
  if (found.turns.empty()) return "";
  return fmt::format("not fitted: {} row{} at which the rate of the depth{} jumps\n",
                     found.turns.size(), found.turns.size() == 1 ? "" : "s",
                     found.shear.rows > 0 ? " or of the shear" : "");
}

std::string depth_error_text(const DepthErrorFound& error) {
  if (!(error.deviation > 0)) return "";
  return fmt::format("errors of the depth: {:.2g} m{}, contained in the fit and in the intervals\n",
                     error.deviation,
                     error.estimated ? ", by the scatter of depths and forces" : "");
}

/// "friction: mu = 0.6 would add 4 % of the peak at most and move modulus by -5 %, …".
std::string friction_text(const CalibrationReport& report) {
  const FrictionShare& friction = report.found.friction;
  if (friction.mu == 0) return "";
  if (friction.moved.empty())
    return fmt::format("with friction: mu = {:.3g} adds {} of the peak at most\n", friction.mu,
                       percent(friction.largest));
  std::string text =
      fmt::format("without friction: mu = {:.3g} adds {} of the peak at most; with it", friction.mu,
                  percent(friction.largest));
  const char* between = " ";
  for (std::size_t k = 0; k < friction.moved.size(); ++k) {
    const FittedNumber &moved = friction.moved[k], &number = report.found.numbers[k];
    if (moved.name.starts_with("pressure") && k + 1 < std::size_t(report.knots)) continue;
    const bool zero = moved.name == kZero || moved.name == kForceZero || moved.name == kPlaceX ||
                      moved.name == kPlaceY;
    text += between + label_of(moved.name, report) +
            (zero ? fmt::format(" is {:.3g} larger", moved.value)
                  : fmt::format(" changes by {:+.2g} %", 100 * moved.value / number.value));
    between = ", ";
  }
  return text + "\n";
}

Json error_json(const PressError& error) {
  if (error.rows == 0) return nullptr;
  return {{"rows", error.rows},
          {"root_mean_square", error.root_mean_square},
          {"largest", error.largest},
          {"largest_by_row", error.largest_by_row}};
}

}  // namespace

std::string report_text(const CalibrationReport& report) {
  const Calibration& found = report.found;
  std::string text = found.numbers.empty() ? ""
                                           : fmt::format("{:<28}{:>12}   {:<26}{}\n", "number",
                                                         "fitted", "95 % interval", "layout");
  for (const FittedNumber& n : found.numbers)
    text += fmt::format("{:<28}{:>12.5g}   {:<26}{}\n", label_of(n.name, report), n.value,
                        interval_text(n), own_text(n.name, report.own));
  const std::size_t points = report.points;
  text += error_text(points > 0 ? "pressing forces" : "normal force", found.normal, points);
  if (percent(report.written.root_mean_square) != percent(found.normal.root_mean_square))
    text += error_text(fmt::format("the layout scored {}", report.beside), report.written, points);
  text += error_text("held out", found.normal_held_out, points);
  text += error_text("the other recording", report.other, points);
  text += error_text(points > 0 ? "forces along the skin" : "shear force", found.shear, points);
  text += error_text("held out", found.shear_held_out, points);
  for (const UntoldNumber& n : found.untold)
    text += fmt::format("not told: {}: {}\n", label_of(n.name, report), n.reason);
  for (const GivenNumber& n : found.given) text += given_text(n, report);
  text += zeros_text(found) + depth_error_text(found.depth_error) + turns_text(found) +
          friction_text(report);
  if (!found.converged) text += "the fit has not come to an end\n";
  text.pop_back();
  return text;
}

void report_json(const CalibrationReport& report, const Console& console) {
  const Calibration& found = report.found;
  Json numbers = Json::array(), untold = Json::array(), given = Json::array();
  for (const FittedNumber& n : found.numbers)
    numbers.push_back(
        {{"number", n.name}, {"value", n.value}, {"low", finite(n.low)}, {"high", finite(n.high)}});
  for (const UntoldNumber& n : found.untold)
    untold.push_back({{"number", n.name}, {"reason", n.reason}});
  for (const GivenNumber& n : found.given)
    given.push_back({{"number", n.name},
                     {"error", n.error},
                     {"moved", n.moved.empty() ? Json() : Json(n.moved)},
                     {"change", n.change},
                     {"told", n.told}});
  Json moved = Json::array();
  for (const FittedNumber& n : found.friction.moved)
    moved.push_back({{"number", n.name}, {"value", n.value}});
  const auto& correlation = found.zero_correlation;
  console.result(
      {{"command", "calibrate"},
       {"exit_code", report.exit_code},
       {"output", report.output.empty() ? Json() : Json(report.output)},
       {"points", report.points},
       {"numbers", numbers},
       {"table_depth", report.knots > 0 ? Json(found.found.at("table_depth")) : Json()},
       {"untold", untold},
       {"given", given},
       {"zero_correlation", correlation ? Json(*correlation) : Json()},
       {"rows_above", found.rows_above},
       {"turns", found.turns},
       {"depth_error",
        {{"deviation", found.depth_error.deviation}, {"estimated", found.depth_error.estimated}}},
       {"friction",
        {{"mu", found.friction.mu}, {"largest", found.friction.largest}, {"moved", moved}}},
       {"held_out", found.held_out},
       {"normal", error_json(found.normal)},
       {"written", error_json(report.written)},
       {"normal_held_out", error_json(found.normal_held_out)},
       {"other", error_json(report.other)},
       {"shear", error_json(found.shear)},
       {"shear_held_out", error_json(found.shear_held_out)},
       {"warnings", report.warnings},
       {"converged", found.converged}});
}

}  // namespace tangere::apps
