// SPDX-License-Identifier: Apache-2.0
// Compares a fit with its start, or with the true numbers of a trial.
#include "apps/identify_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/base/as_size.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "io/picture/line_plot.hpp"

namespace tangere::apps {
namespace {

constexpr double kSameMisfit = 1.001;  // times the smallest

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

PlotPanel misfit_panel(const Identification& fit) {
  PlotPanel panel{"The fit", {"iteration"}, {"over its first value", /*decades=*/true}, {}};
  panel.curves = {{.name = "misfit"}, {.name = "|gradient|", .colour = 1}};
  for (std::size_t k = 0; k < fit.points.size(); ++k) {
    const double iteration = static_cast<double>(k);
    panel.curves[0].points.push_back({iteration, fit.points[k].misfit / fit.points[0].misfit});
    panel.curves[1].points.push_back({iteration, fit.points[k].gradient / fit.points[0].gradient});
  }
  return panel;
}

PlotPanel values_panel(const IdentifyReport& r) {
  const char* over = r.truth.empty() ? "their start" : "their true values";
  PlotPanel panel{fmt::format("Numbers over {}", over), {"iteration"}, {"ratio"}, {}};
  for (std::size_t n = 0; n < r.names.size(); ++n) {
    PlotCurve curve{.name = r.names[n], .colour = static_cast<int>(n)};
    for (std::size_t k = 0; k < r.fit.points.size(); ++k)
      curve.points.push_back({static_cast<double>(k), r.fit.points[k].values[n] / reference(r)[n]});
    panel.curves.push_back(std::move(curve));
  }
  return panel;
}

/// Forces on all sensors over time, recorded and fitted.
PlotPanel forces_panel(const FieldSequence& recorded, const FieldSequence& fitted,
                       double timestep) {
  PlotPanel panel{
      "Force on the sensors: recorded (dots) and fitted", {"time [s]"}, {"force [N]"}, {}};
  const std::array<const char*, 3> names = {"shear along axis0", "shear along axis1", "pressure"};
  for (const FieldSequence* s : {&recorded, &fitted})
    for (std::size_t c = 0; c < 3; ++c) {
      PlotCurve curve{.colour = static_cast<int>(c)};
      if (s == &recorded)
        curve.mark = PlotMark::small_dot, curve.line = false;
      else
        curve.name = names[c];
      for (std::size_t k = 0; k < s->readings.size(); ++k) {
        double sum = 0;
        for (std::size_t i = c; i < s->readings[k].size(); i += 3) sum += s->readings[k][i];
        curve.points.push_back(
            {timestep * static_cast<double>(s->every) * static_cast<double>(k + 1), sum});
      }
      panel.curves.push_back(std::move(curve));
    }
  return panel;
}

/// The noise over the peak [%], for a title and for people.
double noise_percent(const IdentifyReport& r) {
  return r.peak > 0 ? 100 * r.fit.noise / r.peak : 0;
}

/// Pairs of numbers whose estimates are nearly proportional to each other.
constexpr double kNotableCorrelation = 0.95;

double correlation(const Identification& fit, std::size_t j, std::size_t k) {
  return fit.correlation[j * fit.deviation.size() + k];
}

/// "'a' and 'b' (0.97), 'b' and 'c' (-0.99)"
std::string correlated_text(const IdentifyReport& r) {
  std::string text;
  for (std::size_t j = 0; j < r.names.size(); ++j)
    for (std::size_t k = j + 1; k < r.names.size(); ++k)
      if (std::abs(correlation(r.fit, j, k)) > kNotableCorrelation)
        text += fmt::format("{}'{}' and '{}' ({:.4g})", text.empty() ? "" : ", ", r.names[j],
                            r.names[k], correlation(r.fit, j, k));
  return text;
}

std::string inseparable_text(const IdentifyReport& r) {
  std::string names;
  for (const int k : r.fit.inseparable)
    names += fmt::format("{}'{}'", names.empty() ? "" : ", ", r.names[as_size(k)]);
  return fmt::format(
      "the recording does not determine {}: condition {:.2g}; seek fewer numbers at a time, or "
      "record a motion that shows them",
      names, r.fit.condition);
}

/// What is left, and what independent noise would leave.
std::string residual_text(const IdentifyReport& r) {
  const ResidualTest& t = r.fit.residual;
  std::string text =
      fmt::format("what is left is not independent noise ({:.3g} standard deviations): ", t.score);
  if (t.chi_square > 0)
    text += fmt::format("its variance is {:.3g} times that of the stated noise; ", t.chi_square);
  text += fmt::format(
      "summed over the touched points of a reading it has {:.3g} times the variance of independent "
      "errors, {:.2g} of it in common with the next reading",
      t.spread, t.persistence / t.spread);
  if (!t.sensor.empty())
    text += fmt::format(", and a mean of {:.2g} on sensor '{}'", t.mean, t.sensor);
  if (!t.suspect.empty())
    text += fmt::format("; another '{}' ({:+.2g} %) would fit best, by {:.3g} standard deviations",
                        t.suspect, 100 * t.suspect_change, std::abs(t.suspect_score));
  return text +
         fmt::format(
             "; the model, its other numbers or its controls are not those of the recording, or "
             "the noise is not independent. The deviations are {:.3g} times those of noise alone",
             std::sqrt(1 + t.excess));
}

/// How many fits ended where the best did, of how many that were tried.
std::string starts_text(const Identification& fit) {
  const auto same = std::ranges::count_if(fit.fits, [&](const FitEnds& e) {
    return e.misfit <= kSameMisfit * fit.points.back().misfit;
  });
  return fmt::format("{} of {} starts end at the smallest misfit", same, fit.fits.size());
}

Json residual_json(const ResidualTest& t) {
  return {{"tested", t.tested},
          {"is_noise", t.is_noise()},
          {"score", finite(t.score)},
          {"chi_square", t.chi_square > 0 ? finite(t.chi_square) : Json()},
          {"spread", t.spread},
          {"persistence", t.persistence},
          {"mean", t.mean},
          {"excess", t.excess},
          {"suspect", t.suspect.empty() ? Json() : Json(t.suspect)},
          {"suspect_score", t.suspect_score},
          {"suspect_change", t.suspect_change}};
}

Json fits_json(const Identification& fit) {
  Json fits = Json::array();
  for (const FitEnds& e : fit.fits)
    fits.push_back({{"start", e.start},
                    {"end", e.end},
                    {"misfit", finite(e.misfit)},
                    {"converged", e.converged}});
  return fits;
}

Json correlations_json(const Identification& fit) {
  Json rows = Json::array();
  for (std::size_t j = 0; j < fit.deviation.size(); ++j) {
    rows.push_back(Json::array());
    for (std::size_t k = 0; k < fit.deviation.size(); ++k)
      rows.back().push_back(finite(correlation(fit, j, k)));
  }
  return rows;
}

Json json_of(const IdentifyReport& r, const std::vector<std::string>& units) {
  Json numbers = Json::array(), points = Json::array(), inseparable = Json::array();
  for (const int k : r.fit.inseparable) inseparable.push_back(r.names[as_size(k)]);
  for (std::size_t k = 0; k < r.names.size(); ++k) {
    numbers.push_back({{"name", r.names[k]},
                       {"unit", units[k]},
                       {"start", r.fit.fits.front().start[k]},
                       {"found", r.fit.values()[k]},
                       {"deviation", finite(r.fit.deviation[k])}});
    if (!r.truth.empty()) numbers.back()["true"] = r.truth[k];
  }
  for (const FitPoint& p : r.fit.points)
    points.push_back({{"values", p.values}, {"misfit", p.misfit}, {"gradient", p.gradient}});
  return {{"command", "identify"},
          {"exit_code", static_cast<int>(exit_code(r))},
          {"converged", r.fit.converged},
          {"passed", r.fit.passed()},
          {"numbers", numbers},
          {"readings", r.recorded.readings.size()},
          {"peak", r.peak},
          {"noise", r.fit.noise},
          {"condition", finite(r.fit.condition)},
          {"correlations", correlations_json(r.fit)},
          {"inseparable", inseparable},
          {"residual", residual_json(r.fit.residual)},
          {"starts", fits_json(r.fit)},
          {"gradient_difference", finite(r.fit.gradient_difference)},
          {"points", points}};
}

}  // namespace

ExitCode exit_code(const IdentifyReport& report) {
  return report.fit.passed() ? kDone : kSomeFailed;
}

void print(const Console& console, const IdentifyReport& r) {
  const std::vector<double>&start = r.fit.fits.front().start, &found = r.fit.values();
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
                  "of their peak; condition {:.4g}; {}",
                  r.fit.converged ? "converged" : "NOT converged", r.fit.points.size() - 1,
                  r.fit.noise, noise_percent(r), r.fit.condition, starts_text(r.fit)));
  if (const std::string pairs = correlated_text(r); !pairs.empty())
    console.print("estimates that go together (correlation): " + pairs);
  if (r.fit.residual.is_noise())
    console.print(
        r.fit.residual.tested
            ? fmt::format("what is left can be noise: the largest test is {:.2g} standard "
                          "deviations, below {:g}",
                          r.fit.residual.score, ResidualTest::kMostScore)
            : "what is left was not tested: it is below 1e-4 of the fields, or there are "
              "too few readings");
  if (!r.fit.converged) console.fail("the fit has not come to an end");
  if (!r.fit.inseparable.empty()) console.fail(inseparable_text(r));
  if (!r.fit.residual.is_noise()) console.fail(residual_text(r));
  console.detail(
      fmt::format("adjoint gradient against differences at the start: {:.1e} of its "
                  "norm",
                  r.fit.gradient_difference));
  console.result(json_of(r, units));
}

std::string draw(const IdentifyReport& r, const FieldSequence& fitted, double timestep) {
  return render_line_plot_svg(
      {"Numbers of " + r.scene.name + " from a recording",
       {fmt::format("{:.2g} % of the fields' peak is left; condition {:.1f}", noise_percent(r),
                    r.fit.condition)},
       {misfit_panel(r.fit), values_panel(r), forces_panel(r.recorded, fitted, timestep)}});
}

}  // namespace tangere::apps
