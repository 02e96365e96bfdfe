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
  if (!std::isfinite(n.high)) return "not known";
  return fmt::format("{:.4g} to {:.4g}", n.low, n.high);
}

/// "modulus [Pa]", "ks [N/m³]", "pressure at 0.001 m [Pa]" …
std::string label_of(const std::string& number, const CalibrationReport& of) {
  static const std::map<std::string, const char*> kUnits = {
      {"modulus", "Pa"}, {"relaxation", "s"}, {"zero", "m"},
      {"lag", "s"},      {"slider", "N/m"},   {"slider_force", "N"}};
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

std::string error_text(const char* what, const PressError& error) {
  if (error.rows == 0) return "";
  return fmt::format(
      "{}, {} row{}: off by {} of the peak (root mean square), {} at most; {} of a row's own force "
      "at most\n",
      what, error.rows, error.rows == 1 ? "" : "s", percent(error.root_mean_square),
      percent(error.largest), percent(error.largest_by_row));
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
  std::string text =
      fmt::format("{:<28}{:>12}   {:<26}{}\n", "number", "fitted", "95 % interval", "layout");
  for (const FittedNumber& n : found.numbers)
    text += fmt::format("{:<28}{:>12.5g}   {:<26}{}\n", label_of(n.name, report), n.value,
                        interval_text(n), own_text(n.name, report.own));
  text += error_text("normal force", found.normal);
  text += error_text("held out", found.normal_held_out);
  text += error_text("the other recording", report.other);
  text += error_text("shear force", found.shear);
  text += error_text("held out", found.shear_held_out);
  for (const UntoldNumber& n : found.untold)
    text += fmt::format("not told: {}: {}\n", label_of(n.name, report), n.reason);
  if (!found.converged) text += "the fit has not come to an end\n";
  text.pop_back();
  return text;
}

void report_json(const CalibrationReport& report, const Console& console) {
  const Calibration& found = report.found;
  Json numbers = Json::array(), untold = Json::array();
  for (const FittedNumber& n : found.numbers)
    numbers.push_back(
        {{"number", n.name}, {"value", n.value}, {"low", finite(n.low)}, {"high", finite(n.high)}});
  for (const UntoldNumber& n : found.untold)
    untold.push_back({{"number", n.name}, {"reason", n.reason}});
  console.result({{"command", "calibrate"},
                  {"exit_code", static_cast<int>(found.converged ? kDone : kSomeFailed)},
                  {"numbers", numbers},
                  {"table_depth", report.knots > 0 ? Json(found.found.at("table_depth")) : Json()},
                  {"untold", untold},
                  {"held_out", found.held_out},
                  {"normal", error_json(found.normal)},
                  {"normal_held_out", error_json(found.normal_held_out)},
                  {"other", error_json(report.other)},
                  {"shear", error_json(found.shear)},
                  {"shear_held_out", error_json(found.shear_held_out)},
                  {"converged", found.converged}});
}

}  // namespace tangere::apps
