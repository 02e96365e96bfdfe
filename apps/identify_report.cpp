// SPDX-License-Identifier: Apache-2.0
// Compares a fit with its start, or with the true numbers of a trial.
#include "apps/identify_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "engine/derivative/number_gradients.hpp"
#include "io/picture/series_plot.hpp"

namespace tangere::apps {
namespace {

/// Returns the units of the sought numbers.
std::vector<std::string> units_of(const IdentifyReport& r) {
  const NumberGradients numbers{Model(r.scene)};
  const auto infos = numbers.infos();
  std::vector<std::string> units;
  for (const std::string& name : r.names)
    units.push_back(std::ranges::find(infos, name, &NumberInfo::name)->unit);
  return units;
}

/// The value to which a number is compared: the true one of a trial, else the scene's.
const std::vector<double>& reference(const IdentifyReport& r) {
  return r.truth.empty() ? r.fit.points.front().values : r.truth;
}

CurvePanel misfit_panel(const Identification& fit) {
  CurvePanel panel{"The fit",
                   "iteration",
                   "over its first value",
                   true,
                   {{"misfit", {}, {}, false, 0}, {"|gradient|", {}, {}, false, 1}}};
  for (std::size_t k = 0; k < fit.points.size(); ++k) {
    for (Curve& c : panel.curves) c.x.push_back(static_cast<double>(k));
    panel.curves[0].y.push_back(fit.points[k].misfit / fit.points[0].misfit);
    panel.curves[1].y.push_back(fit.points[k].gradient / fit.points[0].gradient);
  }
  return panel;
}

CurvePanel values_panel(const IdentifyReport& r) {
  const char* over = r.truth.empty() ? "their start" : "their true values";
  CurvePanel panel{fmt::format("Numbers over {}", over), "iteration", "ratio", false, {}};
  for (std::size_t n = 0; n < r.names.size(); ++n) {
    Curve c{r.names[n], {}, {}, false, static_cast<int>(n)};
    for (std::size_t k = 0; k < r.fit.points.size(); ++k) {
      c.x.push_back(static_cast<double>(k));
      c.y.push_back(r.fit.points[k].values[n] / reference(r)[n]);
    }
    panel.curves.push_back(std::move(c));
  }
  return panel;
}

/// Forces on all sensors over time, recorded and fitted.
CurvePanel forces_panel(const FieldSequence& recorded, const FieldSequence& fitted,
                        double timestep) {
  CurvePanel panel{
      "Force on the sensors: recorded (dots) and fitted", "time [s]", "force [N]", false, {}};
  const std::array<const char*, 3> names = {"shear along axis0", "shear along axis1", "pressure"};
  for (const FieldSequence* s : {&recorded, &fitted})
    for (std::size_t c = 0; c < 3; ++c) {
      Curve curve{s == &recorded ? "" : names[c], {}, {}, s == &recorded, static_cast<int>(c)};
      for (std::size_t k = 0; k < s->readings.size(); ++k) {
        double sum = 0;
        for (std::size_t i = c; i < s->readings[k].size(); i += 3) sum += s->readings[k][i];
        curve.x.push_back(timestep * static_cast<double>(s->every) * static_cast<double>(k + 1));
        curve.y.push_back(sum);
      }
      panel.curves.push_back(std::move(curve));
    }
  return panel;
}

/// The noise over the peak [%], for a title and for people.
double noise_percent(const IdentifyReport& r) {
  return r.peak > 0 ? 100 * r.fit.noise / r.peak : 0;
}

Json json_of(const IdentifyReport& r, const std::vector<std::string>& units) {
  Json numbers = Json::array(), points = Json::array();
  for (std::size_t k = 0; k < r.names.size(); ++k) {
    numbers.push_back({{"name", r.names[k]},
                       {"unit", units[k]},
                       {"start", r.fit.points.front().values[k]},
                       {"found", r.fit.values()[k]},
                       {"deviation", finite(r.fit.deviation[k])}});
    if (!r.truth.empty()) numbers.back()["true"] = r.truth[k];
  }
  for (const FitPoint& p : r.fit.points)
    points.push_back({{"values", p.values}, {"misfit", p.misfit}, {"gradient", p.gradient}});
  return {{"command", "identify"},
          {"exit_code", static_cast<int>(r.fit.converged ? kDone : kSomeFailed)},
          {"converged", r.fit.converged},
          {"numbers", numbers},
          {"readings", r.recorded.readings.size()},
          {"peak", r.peak},
          {"noise", r.fit.noise},
          {"condition", finite(r.fit.condition)},
          {"gradient_difference", finite(r.fit.gradient_difference)},
          {"points", points}};
}

}  // namespace

void print(const Console& console, const IdentifyReport& r) {
  const std::vector<double>&start = r.fit.points.front().values, &found = r.fit.values();
  const std::vector<std::string> units = units_of(r);
  std::size_t width = 6;
  for (const std::string& name : r.names) width = std::max(width, name.size());
  const bool trial = !r.truth.empty();
  console.print(fmt::format("{:<{}} {:>12}{} {:>12} {:>14}  {}", "number", width, "start",
                            trial ? fmt::format(" {:>12}", "true") : "", "found", "deviation [%]",
                            "unit"));
  for (std::size_t k = 0; k < r.names.size(); ++k)
    console.print(fmt::format("{:<{}} {:>12.6g}{} {:>12.6g} {:>14.3g}  {}", r.names[k], width,
                              start[k], trial ? fmt::format(" {:>12.6g}", r.truth[k]) : "",
                              found[k], 100 * r.fit.deviation[k], units[k]));
  console.print(
      fmt::format("{} after {} steps; what is left of a number of the fields: {:.3g} N, {:.2g} % "
                  "of their peak; condition {:.1f}",
                  r.fit.converged ? "converged" : "NOT converged", r.fit.points.size() - 1,
                  r.fit.noise, noise_percent(r), r.fit.condition));
  console.detail(
      fmt::format("adjoint gradient against differences at the start: {:.1e} of its "
                  "norm",
                  r.fit.gradient_difference));
  console.result(json_of(r, units));
}

std::string draw(const IdentifyReport& r, const FieldSequence& fitted, double timestep) {
  const std::array<CurvePanel, 3> panels = {misfit_panel(r.fit), values_panel(r),
                                            forces_panel(r.recorded, fitted, timestep)};
  const std::array<std::string, 1> captions = {fmt::format(
      "{:.2g} % of the fields' peak is left; condition {:.1f}", noise_percent(r), r.fit.condition)};
  return render_curves_svg("Numbers of " + r.scene.name + " from a recording", captions, panels);
}

}  // namespace tangere::apps
