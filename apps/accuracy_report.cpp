// SPDX-License-Identifier: Apache-2.0
// Errors are shown in percent; steps in milliseconds for people, in seconds for programs.
#include "apps/accuracy_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "apps/pitch_report.hpp"
#include "io/picture/line_plot.hpp"
#include "tasks/accuracy/measured_order.hpp"

namespace tangere::apps {
namespace {

constexpr double kKept = 3;        // largest ratio of error to requested accuracy
constexpr double kNotable = 0.01;  // share of a force's energy that is worth a sentence

/// "1.9", or "at most 0.5" where it may be less.
std::string order_words(double order) {
  return (order > RichardsonEstimate::kLeastOrder ? "" : "at most ") + fmt::format("{:.2g}", order);
}

std::string setting_text(const AccuracySetting& setting, double step) {
  if (setting.accuracy > 0)
    return fmt::format("{}, accuracy {:g} in steps of {:g} ms", to_string(setting.integrator),
                       setting.accuracy, 1e3 * step);
  return fmt::format("{}, {:g} ms, tol {:.0e}", to_string(setting.integrator), 1e3 * step,
                     setting.tolerance);
}

/// Whether an error is at most kKept times the requested accuracy, if there is one.
bool kept(const AccuracyPoint& p) {
  return p.setting.accuracy == 0 || p.error <= kKept * p.setting.accuracy;
}

Json point_json(const AccuracyPoint& p) {
  return {{"scheme", to_string(p.setting.integrator)},
          {"step", p.step},
          {"precision", to_string(p.precision)},
          {"tolerance", p.setting.tolerance},
          {"accuracy", p.setting.accuracy},
          {"error", finite(p.error)},
          {"error_bound", finite(p.bound)},
          {"median_error", finite(p.median)},
          {"within_share", finite(p.within)},
          {"kept", p.setting.accuracy > 0 ? Json(kept(p)) : Json()},
          {"simulated_seconds_per_cpu_second", finite(p.rate)},
          {"evaluations_per_step", p.evaluations},
          {"split_share", finite(p.split)},
          {"blurred", p.blurred},
          {"envs", p.errors.size()},
          {"failed", p.failed},
          {"status", p.status}};
}

Json points_json(const std::vector<AccuracyPoint>& points) {
  Json all = Json::array();
  for (const AccuracyPoint& p : points) all.push_back(point_json(p));
  return all;
}

Json orders_json(const std::vector<SchemeOrder>& orders) {
  Json all = Json::array();
  for (const SchemeOrder& o : orders)
    all.push_back({{"scheme", to_string(o.integrator)},
                   {"order", o.order},
                   {"order_of_scheme", o.integrator.scheme().order},
                   {"coarse_step", o.coarse},
                   {"fine_step", o.fine}});
  return all;
}

/// The setting that comes nearest to a target that none meets.
std::string nearest_text(const AccuracyReport& report) {
  const auto nearest = std::ranges::min_element(report.points, {}, &AccuracyPoint::bound);
  if (nearest == report.points.end() || !std::isfinite(nearest->bound)) return {};
  return fmt::format(" {} comes nearest: {}, and {} in the worst environments.",
                     setting_text(nearest->setting, nearest->step), percent(nearest->error),
                     percent(nearest->bound));
}

/// What of the scene keeps schemes from their order, if they share errors.
std::string first_order_text(const AccuracyReport& report, const Model& model) {
  std::string laws;
  for (const std::string& law : first_order_laws(model.scene()))
    laws += (laws.empty() ? "" : ", ") + law;
  if (!report.reference.shares_errors()) return {};
  const std::string shared = " All schemes share most of the error";
  return laws.empty()
             ? shared + "."
             : shared + ": these can be of first order in the step with each of them: " + laws +
                   ".";
}

/// The reason why the reference is too inaccurate, and remedies.
std::string unresolved_text(const AccuracySubject& subject, const AccuracyReport& report,
                            const Model& model) {
  const AccuracyReference& r = report.reference;
  if (!std::isfinite(r.error))
    return fmt::format("Not resolved: at {:g} ms there is nothing to compare with, because {}.",
                       1e3 * r.step, r.status);
  std::string text = fmt::format(
      "Not resolved: even at {:g} ms the reference is off by {} (SDIRK2 differs by {}, twice the "
      "step by {}, order {}), so no error below {} can be told, and no setting is known to "
      "reach {}.",
      1e3 * r.step, percent(r.error), percent(r.scheme_distance), percent(r.step_distance),
      order_words(r.order), percent(3 * r.error), percent(subject.target));
  text += first_order_text(report, model);
  if (report.vibration.sensor >= 0 && report.vibration.share > kNotable)
    text += fmt::format(
        " {:.2g} % of the energy of the force on '{}' is too fast for the samples to show; the "
        "strongest vibration there has {:.3g} Hz. Give the contact or the joints that hold it more "
        "damping, average fields over one period, or compare the state with --quantity state.",
        100 * report.vibration.share,
        model.sensors()[static_cast<std::size_t>(report.vibration.sensor)].name,
        report.vibration.frequency);
  return text;
}

/// Lists the requested accuracies that cut steps miss.
std::string unkept_text(const AccuracyReport& report) {
  std::string missed;
  for (const AccuracyPoint& p : report.points)
    if (p.precision == Precision::f64 && !kept(p))
      missed += fmt::format("{}{:g} reaches {}", missed.empty() ? "" : ", ", p.setting.accuracy,
                            percent(p.error));
  if (missed.empty()) return {};
  return " Cut steps miss the requested accuracy: " + missed + ".";
}

/// Adds a curve of the points whose settings belong to it: labelled by step in ms, or by accuracy.
void add_curve(PlotPanel& panel, const AccuracyReport& report, const std::string& name,
               const std::function<bool(const AccuracySetting&)>& belongs) {
  PlotCurve curve{name, {}, PlotMark::dot};
  curve.colour = static_cast<int>(panel.curves.size());
  for (const AccuracyPoint& p : report.points) {
    if (p.precision != Precision::f64 || !belongs(p.setting)) continue;
    const double label = p.setting.accuracy > 0 ? p.setting.accuracy : 1e3 * p.step;
    curve.points.push_back({p.error, 1 / p.rate, fmt::format("{:g}", label), p.blurred});
  }
  if (!curve.points.empty()) panel.curves.push_back(std::move(curve));
}

}  // namespace

std::string accuracy_heading(const AccuracySubject& subject, const FixedEpisodes& episodes) {
  return fmt::format(
      "{}: {} of {} environments over {:g} s, sampled every {:g} ms, against a reference; {}; {}\n"
      "error: not exceeded in 95 % of the environments; ~: at most ten times the "
      "reference's own\n",
      subject.name, to_string(subject.quantity), subject.environments, subject.seconds,
      1e3 * episodes.interval(), subject.isa, subject.machine);
}

std::string reference_row(const AccuracyReference& reference, int environments) {
  std::string row = fmt::format(
      "reference {}: SDIRK2 at the same step differs by {:.1e}, its own twice the step "
      "by {:.1e} (order {}); off by {:.1e}",
      setting_text(reference.setting, reference.step), reference.scheme_distance,
      reference.step_distance, order_words(reference.order), reference.error);
  // An error of a few environments must not pass for one of all.
  if (reference.environments < environments)
    row += fmt::format("; only {} of {} environments have something to compare",
                       reference.environments, environments);
  return reference.failed == 0 ? row : row + "; " + reference.status;
}

std::string accuracy_head() {
  return fmt::format(
      "\n{:<10} {:>9} {:>8} {:>8} {:>10} {:>10} {:>11}   simulated seconds per CPU second",
      "scheme", "step [ms]", "accuracy", "tol", "error", "median", "evaluations");
}

std::string accuracy_row(std::span<const AccuracyPoint> points) {
  const AccuracyPoint& p = points.front();
  std::string row = fmt::format(
      "{:<10} {:>9.4g} {:>8} {:>8.0e} {:>9}{} {:>10} {:>11.2f}   ", to_string(p.setting.integrator),
      1e3 * p.step, p.setting.accuracy > 0 ? fmt::format("{:g}", p.setting.accuracy) : "-",
      p.setting.tolerance, percent(p.error), p.blurred ? "~" : " ", percent(p.median),
      p.evaluations);
  for (const AccuracyPoint& q : points)
    row += fmt::format("{:.4g}{}", q.rate,
                       points.size() == 1 ? "" : fmt::format(" {}  ", to_string(q.precision)));
  if (p.failed > 0) row += p.status;
  return row;
}

std::string order_text(const AccuracyReport& report, const Model& model) {
  if (report.orders.empty()) return {};
  std::string text;
  for (const SchemeOrder& o : report.orders)
    text += fmt::format("{}{} {:.2g} ({})", text.empty() ? "" : ", ", to_string(o.integrator),
                        o.order, o.integrator.scheme().order);
  return "\norder of the errors here (on smooth motion): " + text + "." +
         first_order_text(report, model) + unkept_text(report) + "\n";
}

std::string advice_text(const AccuracySubject& subject, const AccuracyReport& report,
                        const Model& model) {
  if (!report.resolved) return unresolved_text(subject, report, model);
  const std::string own = report.own.rate > 0
                              ? fmt::format(" The scene's own setting ({}) reaches {} at {:.4g}.",
                                            setting_text(report.own.setting, report.own.step),
                                            percent(report.own.error), report.own.rate)
                              : std::string();
  if (report.advice < 0)
    return fmt::format("{} is sure to reach {}.{}{}",
                       report.stopped ? "Stopped: none of the settings so far" : "No setting",
                       percent(subject.target), nearest_text(report), own);
  const AccuracyPoint& best = report.points[static_cast<std::size_t>(report.advice)];
  const std::string others =
      percent(best.bound) == percent(best.error)
          ? std::string()
          : fmt::format(" 95 of 100 other environments should stay below {}.", percent(best.bound));
  const std::string fields = subject.quantity == AccuracyQuantity::tactile
                                 ? fmt::format(", {} fields", to_string(best.precision))
                                 : std::string();
  return fmt::format("{}For {} use {}{}: {} at {:.4g} simulated seconds per CPU second.{}{}{}",
                     report.stopped ? "Stopped: of the settings so far: " : "",
                     percent(subject.target), setting_text(best.setting, best.step), fields,
                     percent(best.error), best.rate, others, own,
                     pitch_advice(report.pitches, model, subject.target));
}

Json accuracy_json(const AccuracySubject& subject, const AccuracyReport& report,
                   const Model& model) {
  Json advice = report.advice >= 0
                    ? point_json(report.points[static_cast<std::size_t>(report.advice)])
                    : Json::object();
  if (!report.resolved) advice = Json::object();
  advice["resolved"] = report.resolved;
  advice["text"] = advice_text(subject, report, model);
  Json vibration;
  if (report.vibration.sensor >= 0)
    vibration = {
        {"sensor", model.sensors()[static_cast<std::size_t>(report.vibration.sensor)].name},
        {"frequency", report.vibration.frequency},
        {"share", report.vibration.share}};
  return {{"command", "accuracy"},
          {"scene", subject.scene},
          {"quantity", to_string(subject.quantity)},
          {"target", subject.target},
          {"envs", subject.environments},
          {"seconds", subject.seconds},
          {"machine", subject.machine},
          {"isa", subject.isa},
          {"stopped", report.stopped},
          {"reference",
           {{"method", setting_text(report.reference.setting, report.reference.step)},
            {"step", report.reference.step},
            {"error", finite(report.reference.error)},
            {"scheme_distance", finite(report.reference.scheme_distance)},
            {"step_distance", finite(report.reference.step_distance)},
            {"order", report.reference.order},
            {"envs", report.reference.environments}}},
          {"orders", orders_json(report.orders)},
          {"first_order_laws", first_order_laws(model.scene())},
          {"points", points_json(report.points)},
          {"tolerances", points_json(report.tolerances)},
          {"pitches", pitches_json(report.pitches, model)},
          {"own", report.own.rate > 0 ? point_json(report.own) : Json()},
          {"vibration", vibration},
          {"advice", advice}};
}

std::string accuracy_csv(const AccuracySubject& subject, const AccuracyReport& report) {
  std::string name = "\"";
  for (const char c : subject.name) name += c == '"' ? std::string("\"\"") : std::string(1, c);
  name += '"';
  std::string text =
      "scene,quantity,sweep,scheme,step,precision,tolerance,accuracy,error,error_bound,median_"
      "error,"
      "simulated_seconds_per_cpu_second,evaluations_per_step,split_share,blurred,failed\n";
  const auto rows = [&](const char* sweep, const std::vector<AccuracyPoint>& points) {
    for (const AccuracyPoint& p : points)
      text += fmt::format(
          "{},{},{},{},{:.9g},{},{:g},{:g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:d},{}\n",
          name, to_string(subject.quantity), sweep, to_string(p.setting.integrator), p.step,
          to_string(p.precision), p.setting.tolerance, p.setting.accuracy, p.error, p.bound,
          p.median, p.rate, p.evaluations, p.split, p.blurred, p.failed);
  };
  rows("step", report.points);
  rows("tolerance", report.tolerances);
  if (report.own.rate > 0) rows("own", {report.own});
  return text;
}

bool can_draw(const AccuracyReport& report) {
  return std::ranges::any_of(report.points, [](const AccuracyPoint& p) {
    return p.error > 0 && std::isfinite(p.error) && p.rate > 0;
  });
}

std::string accuracy_svg(const AccuracySubject& subject, const AccuracyReport& report) {
  PlotPanel panel;
  panel.height = 380;
  panel.x = {fmt::format("relative error of the {}, not exceeded in 95 % of the environments",
                         accuracy_meaning(subject.quantity)),
             /*decades=*/true};
  panel.y = {"CPU seconds per simulated second [1]", /*decades=*/true};
  for (const Integrator integrator : integrators())
    add_curve(panel, report, to_string(integrator), [&](const AccuracySetting& s) {
      return s.accuracy == 0 && s.integrator == integrator;
    });
  add_curve(panel, report, "cut steps", [](const AccuracySetting& s) { return s.accuracy > 0; });
  if (report.own.rate > 0)
    panel.curves.push_back(
        {"", {{report.own.error, 1 / report.own.rate, "the scene's"}}, PlotMark::star, false});
  panel.verticals = {{report.reference.error, "reference"}};
  if (subject.target > 0) panel.verticals.push_back({subject.target, "target", true});
  return render_line_plot_svg(
      {subject.name + ": what accuracy costs",
       {fmt::format("{} of {} environments over {:g} s; {}, {}", to_string(subject.quantity),
                    subject.environments, subject.seconds, subject.machine, subject.isa),
        fmt::format("reference {}, its own error {:.1e} (line); hollow: at most ten times it",
                    setting_text(report.reference.setting, report.reference.step),
                    report.reference.error)},
       {std::move(panel)},
       "numbers: step size [ms]; the lower left is best; star: the setting of the scene"});
}

}  // namespace tangere::apps
