// SPDX-License-Identifier: Apache-2.0
// tangere calibrate: fits a sensor's layout to a recorded press.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <iterator>

#include "apps/arguments.hpp"
#include "apps/calibrate_channels.hpp"
#include "apps/calibrate_pictures.hpp"
#include "apps/calibrate_report.hpp"
#include "apps/command.hpp"
#include "apps/layout_text.hpp"
#include "apps/press_scene.hpp"
#include "apps/press_table.hpp"
#include "apps/run_options.hpp"
#include "apps/text_output.hpp"
#include "engine/base/error.hpp"
#include "tasks/calibration/press_warnings.hpp"

namespace tangere::apps {
namespace {

// Where the layout has none.
constexpr double kUsualFriction = 0.6, kUsualShearShare = 0.4, kUsualRelaxation = 1e-3;
constexpr int kMostKnots = 100;
/// Numbers of a recording, which no layout has.
constexpr std::array kRecordingNumbers = {kZero, kForceZero, kPlaceX,     kPlaceY,
                                          kLag,  kSlider,    kSliderForce};

struct CalibrateArguments {
  std::string recording, sensor, output, check, pictures, channels, loads, unit;
  std::vector<std::string> numbers, columns;
  Indenter indenter;
  std::optional<int> table;
  std::optional<double> hold_out, pixel;
  std::vector<double> nodes;
  double zero = 0, depth_error = NAN;  // not a number: not given
  bool score = false, friction = false, overwrite = false;
};

void check_indenter(const CalibrateArguments& a) {
  if (int(a.indenter.ball.has_value()) + int(a.indenter.flat.has_value()) +
          int(!a.indenter.box.empty()) !=
      1)
    throw InputError("expected one of --ball, --flat and --box: the indenter");
  if (a.hold_out && *a.hold_out >= 1 && *a.hold_out != std::floor(*a.hold_out))
    throw InputError(fmt::format(
        "--hold-out {}; expected a number of rows, or a share of them below 1", *a.hold_out));
}

/// Refuses options of one kind of fit beside another.
void refuse(const char* kind, const std::vector<std::pair<const char*, bool>>& options,
            const char* expected) {
  std::vector<std::string> others;
  for (const auto& [name, given] : options)
    if (given) others.emplace_back(name);
  if (!others.empty())
    throw InputError(fmt::format("{} {}; expected {}", fmt::join(others, ", "), kind, expected));
}

void check_arguments(const CalibrateArguments& a) {
  refuse("without --channels",
         {{"--nodes", !a.nodes.empty()},
          {"--loads", !a.loads.empty()},
          {"--unit", !a.unit.empty()},
          {"--zero", a.zero != 0}},
         "both");
  if (a.recording.empty() || a.sensor.empty())
    throw InputError(fmt::format("{} is missing; expected RECORDING and --sensor, or --pictures",
                                 a.recording.empty() ? "RECORDING" : "--sensor"));
  if (a.pixel) throw InputError("--pixel without --pictures; expected both");
  if (a.score)
    refuse("beside --score",
           {{"--fit", !a.numbers.empty()},
            {"--table", a.table.has_value()},
            {"--hold-out", a.hold_out.has_value()},
            {"--depth-error", !std::isnan(a.depth_error)},
            {"--output", !a.output.empty()}},
           "--score alone, which fits and writes nothing");
  if (a.depth_error < 0)
    throw InputError(fmt::format(
        "--depth-error {}; expected the standard deviation of errors of depths [m], or 0 for none",
        a.depth_error));
  check_indenter(a);
}

int run_channels(const CalibrateArguments& a, const Console& console) {
  refuse("beside --channels",
         {{"--pictures", !a.pictures.empty()},
          {"--pixel", a.pixel.has_value()},
          {"--table", a.table.has_value()},
          {"--score", a.score},
          {"--friction", a.friction},
          {"--depth-error", !std::isnan(a.depth_error)},
          {"--column", !a.columns.empty()},
          {"--fit", !a.numbers.empty()}},
         "a fit of the skin's numbers of its own, before");
  check_indenter(a);
  return run_calibrate_channels({a.recording, a.sensor, a.check, a.indenter, a.channels, a.output,
                                 a.nodes, a.loads, a.unit, a.zero, a.hold_out, a.overwrite},
                                console);
}

/// A layout, and what a fit changes in it.
struct Fitted {
  LayoutFile layout, own_layout;  ///< and as it was read
  int knots = 0;                  ///< of a table
  bool per_area = false;          ///< whether coefficients count by area
  bool has_table = false;         ///< of its own, which stays
  SkinNumbers start;              ///< attributes that can be fitted
  SkinNumbers own;                ///< of these, those that the layout has
  std::size_t points = 0;         ///< of the sensor
};

/// Sets the attributes that can be fitted, as the layout has them, where it has any.
void set_start(const TactileDescription& d, Fitted& fitted) {
  const LayoutFile& layout = fitted.layout;
  const double area = d.cell > 0 ? d.cell : 1, kn = d.coefficients.kn / area,
               ks = d.coefficients.ks / area, mu = d.coefficients.mu;
  const auto add = [&](const char* name, double own, double otherwise) {
    if (own > 0) fitted.own[name] = own;
    fitted.start[name] = own > 0 ? own : otherwise;
  };
  if (d.layer || (d.material && !layout.has("kn")))
    add("modulus", d.material ? d.material->modulus : 0, 1);
  else
    add("kn", kn, 1);
  const bool relaxes = d.table || (d.material && (d.layer || !layout.has("damping")));
  const double tau = d.table ? d.table->relaxation : d.material ? d.material->relaxation : 0;
  if (relaxes) add("relaxation", tau, kUsualRelaxation);
  add("ks", ks, kUsualShearShare * (kn > 0 ? kn : 1));
  add("mu", mu, kUsualFriction);
}

/// Refuses what no scene has beside a table, and what press_scene() leaves out.
void check_for_table(const LayoutFile& layout) {
  const auto refuse = [&](const std::string& what) {
    throw InputError(fmt::format("{}--table with {}; expected a layout without it",
                                 layout.source().prefix(), what));
  };
  if (layout.get("feedback") == "true") refuse("feedback");
  for (const char* const name : {"delay", "low_pass", "hysteresis"})
    if (std::strtod(layout.get("imperfections", name).c_str(), nullptr) != 0)
      refuse(fmt::format("{} in <imperfections>", name));
}

/// Makes room for a table. Shear springs that follow from a modulus stay.
void prepare_for_table(Fitted& fitted, const TactileDescription& d) {
  if (!d.points.empty())
    throw InputError("--table with points that are no array; expected type=\"rect_array\"");
  check_for_table(fitted.layout);
  if (d.layer) throw InputError("--table with a layout that has <layer>; expected one of them");
  if (d.cell == 0 && (d.coefficients.ks > 0 || d.coefficients.kt > 0))
    throw InputError(fmt::format("--table with ks or kt by point in {}; expected per=\"area\"",
                                 fitted.layout.source().file));
  if (d.material) {
    fitted.layout.set("ks", fmt::format("{:.5g}", d.coefficients.ks / d.cell));
    fitted.layout.set("kt", fmt::format("{:.5g}", d.coefficients.kt / d.cell));
  }
  for (const char* const name : {"modulus", "thickness", "kn", "damping", "per"})
    fitted.layout.remove(name);
}

/// Sets the attributes among the numbers. `digits`: of what is written; 17 keep every bit.
void set_numbers(const SkinNumbers& numbers, int digits, Fitted& fitted) {
  const auto text = [&](double x) { return fmt::format("{:.{}g}", x, digits); };
  for (const auto& [name, value] : numbers)
    if (fitted.start.contains(name)) fitted.layout.set(name, text(value));
  if (fitted.knots == 0) return;
  std::string depths = "0", pressures = "0";
  for (int k = 1; k <= fitted.knots; ++k) {
    depths += " " + text(numbers.at("table_depth") * k / fitted.knots);
    pressures += " " + text(numbers.at(table_number(k)));
  }
  fitted.layout.set("pressure_depth", depths);
  fitted.layout.set("pressure", pressures);
}

Fitted read_fitted(const CalibrateArguments& a) {
  const LayoutFile layout(layout_text("--sensor", a.sensor), a.sensor);
  Fitted fitted{layout, layout, a.table.value_or(0), false, false, {}, {}, 0};
  const Scene scene = press_scene(fitted.layout, a.indenter);
  const TactileDescription& d = scene.sensors[0];
  fitted.points = tactile_points(d).size();
  if (fitted.knots > 0) prepare_for_table(fitted, d);
  set_start(d, fitted);
  if (fitted.knots > 0) {
    fitted.start.erase("modulus"), fitted.start.erase("kn");
    fitted.start.try_emplace("relaxation", kUsualRelaxation);
  } else if (d.table) {
    fitted.has_table = true;
    fitted.start.erase("kn");
  }
  fitted.per_area = d.cell > 0 || fitted.knots > 0;
  return fitted;
}

void name_as_measured(LayoutFile& layout) {
  std::string name = layout.name();
  if (name.ends_with("_guess")) name.resize(name.size() - 6);
  if (name.find("measured") == std::string::npos) name += "_measured";
  layout.set("name", name);
}

/// The rows that --score compares.
std::vector<int> scored_rows(const PressRecording& recording, bool relaxes) {
  std::vector<int> turns, rows;
  if (relaxes) turns = recording.turns();
  for (int row = 0; row < int(recording.rows()); ++row)
    if (!std::ranges::binary_search(turns, row)) rows.push_back(row);
  return rows;
}

/// The layout with what was fitted, and how far the forces of this very text are off, as --score
/// says.
struct Written {
  LayoutFile layout;
  PressError error;
};

/// Returns the layout with the fitted attributes. It is scored as it will be read: without the
/// zeros and the lag of the recording, and without a slider, which no layout has.
Written written_layout(Fitted fitted, const CalibrateArguments& a, const Calibration& found,
                       const PressRecording& recording) {
  SkinNumbers numbers = found.found;
  for (const UntoldNumber& number : found.untold) numbers.erase(number.name);
  set_numbers(numbers, 5, fitted);
  const auto scene = [&](const SkinNumbers&) { return press_scene(fitted.layout, a.indenter); };
  const PressError error =
      check_calibration({.scene = scene, .start = {}, .friction = a.friction}, {}, recording,
                        scored_rows(recording, fitted.start.contains(kRelaxation)));
  return {std::move(fitted.layout), error};
}

bool is_recording_number(const std::string& name) {
  return std::ranges::count(kRecordingNumbers, name) > 0;
}

/// How a score of the layout differs from the fit: "without zero, lag".
std::string beside_text(const Calibration& found) {
  std::vector<std::string> names;
  for (const FittedNumber& number : found.numbers)
    if (is_recording_number(number.name) && number.name != kSliderForce)
      names.push_back(number.name);
  return names.empty() ? "at all rows" : fmt::format("without {}", fmt::join(names, ", "));
}

/// Names the sensor as measured if anything of it was fitted, and adds comments. Returns whether
/// the layout is another.
bool add_remarks(const Fitted& fitted, const Calibration& found, const std::string& recording,
                 Written& written) {
  std::vector<std::string> names;
  bool slider = false;
  for (const FittedNumber& number : found.numbers) {
    if (fitted.start.contains(number.name)) names.push_back(number.name);
    slider = slider || number.name == kSlider;
  }
  if (fitted.knots > 0) names.emplace_back(kTable);
  const std::string file = std::filesystem::path(recording).filename().string();
  LayoutFile& layout = written.layout;
  if (!names.empty()) {
    name_as_measured(layout);
    std::string text = fmt::format(
        "{}: measured, fitted by 'tangere calibrate' to {}, {} rows, to {} of the peak",
        fmt::join(names, ", "), file, found.normal.rows, percent(found.normal.root_mean_square));
    const std::string score = percent(written.error.root_mean_square);
    if (score != percent(found.normal.root_mean_square) || written.error.rows != found.normal.rows)
      text +=
          fmt::format("; scored {}, {} rows, to {}", beside_text(found), written.error.rows, score);
    layout.add_comment(text);
  }
  if (slider)
    layout.add_comment(
        fmt::format("the slider that was fitted beside it is no part of the layout: {:.5g} N/m and "
                    "{:.5g} N",
                    found.found.at(kSlider), found.found.at(kSliderForce)));
  const auto own = fitted.own.find(kFriction);
  if (!(found.least_friction > (own == fitted.own.end() ? 0 : own->second))) return !names.empty();
  const std::string mu = fmt::format("{:.5g}", found.least_friction);
  layout.set(kFriction, mu);
  layout.add_comment(
      fmt::format("mu: a lower bound, because nothing slips: {} is the largest ratio of shear to "
                  "normal force in {}",
                  mu, file));
  return true;
}

/// Refuses what a fit to photographs does not use.
void check_for_pictures(const CalibrateArguments& a) {
  std::vector<std::string> others;
  for (const auto& [name, given] : {std::pair{"RECORDING", !a.recording.empty()},
                                    {"--sensor", !a.sensor.empty()},
                                    {"--flat", a.indenter.flat.has_value()},
                                    {"--box", !a.indenter.box.empty()},
                                    {"--table", a.table.has_value()},
                                    {"--score", a.score},
                                    {"--friction", a.friction},
                                    {"--depth-error", !std::isnan(a.depth_error)},
                                    {"--column", !a.columns.empty()},
                                    {"--fit", !a.numbers.empty()},
                                    {"--hold-out", a.hold_out.has_value()},
                                    {"--check", !a.check.empty()}})
    if (given) others.emplace_back(name);
  if (!others.empty())
    throw InputError(
        fmt::format("--pictures beside {}; expected --pictures with --ball and --pixel alone",
                    fmt::join(others, ", ")));
}

void warn(std::span<const std::string> warnings, std::size_t from, const std::string& file,
          const Console& console) {
  for (const std::string& warning : warnings.subspan(from))
    console.note(fmt::format("warning: {}: {}", file, warning));
}

/// Says that a fitted table ends level; "" if it does not.
std::string level_text(const Scene& scene) {
  constexpr double kLevel = 1e-3;  // of the last pressure
  const std::optional<PressureTable>& table = scene.sensors[0].table;
  if (!table) return "";
  const double last = table->pressure.back(), before = table->pressure.end()[-2];
  if (last - before > kLevel * last) return "";
  return fmt::format(
      "the table ends level, with {:.3g} Pa from {:.3g} m on, so a body that goes "
      "deeper presses no harder; expected a force that rises with the last depths, "
      "or fewer pressures",
      last, table->depth.end()[-2]);
}

/// Says that a fit leaves much of the forces; "" if it does not.
std::string misfit_text(const Calibration& found) {
  constexpr double kMuch = 0.15, kMuchOfNorm = 0.4;
  const PressError& error = found.normal;
  if (found.numbers.empty() || !(error.root_mean_square > kMuch || error.relative > kMuchOfNorm))
    return "";
  return fmt::format(
      "the fit leaves {} of the peak and {} of the forces' root mean square; expected {} and {} at "
      "most: points in another order than the layout's (rows and columns), units, places or depths "
      "that are not those of the forces, a reading of another sensor, or another indenter",
      percent(error.root_mean_square), percent(error.relative), percent(kMuch),
      percent(kMuchOfNorm));
}

/// The same of a shear; it is zero without one.
std::string shear_misfit_text(const Calibration& found) {
  constexpr double kMuch = 0.3;
  const double left = found.shear.root_mean_square;
  if (found.numbers.empty() || !(left > kMuch)) return "";
  return fmt::format(
      "the fit leaves {} of the peak of the forces along the skin; expected {} at most: units of "
      "shear_force or shear that are not those of force and depth, or another direction",
      percent(left), percent(kMuch));
}

bool is_fitted(const Calibration& found, const char* name) {
  return std::ranges::count(found.numbers, name, &FittedNumber::name) > 0;
}

/// Whether numbers of the layout are fitted, if there are any. `usual`: without names.
bool fits_layout(const CalibrateArguments& a, bool usual) {
  return a.numbers.empty() ? usual : !std::ranges::all_of(a.numbers, is_recording_number);
}

/// " (mu: nothing is sheared, …)".
std::string untold_text(const Calibration& found) {
  std::vector<std::string> reasons;
  for (const UntoldNumber& number : found.untold)
    reasons.push_back(fmt::format("{}: {}", number.name, number.reason));
  return reasons.empty() ? "" : fmt::format(" ({})", fmt::join(reasons, "; "));
}

/// Refuses errors that are no small part of the depths: forces are taken as smooth over them.
void check_depth_error(const CalibrateArguments& a, const PressRecording& recording) {
  constexpr double kMost = 0.1;
  if (!(a.depth_error > 0) || recording.depth.empty()) return;
  const auto [low, high] = std::ranges::minmax(recording.depth);
  if (const double most = kMost * (high - low); !(a.depth_error <= most))
    throw InputError(fmt::format(
        "--depth-error {}; expected metres, a tenth of the range of the recorded depths at most, "
        "{:.3g}",
        a.depth_error, most));
}

/// Refuses an output that would be the layout as it is.
void check_output(const CalibrateArguments& a, const Fitted& fitted) {
  if (a.output.empty() || fits_layout(a, !fitted.has_table)) return;
  if (a.numbers.empty())
    throw InputError(fmt::format(
        "--output with {}, whose table of pressures stays, so that nothing would change; expected "
        "--table N, or no --output",
        a.sensor));
  throw InputError(
      fmt::format("--output beside --fit {}, which no layout has, so that nothing would change; "
                  "expected an attribute of the layout among them, or no --output",
                  fmt::join(a.numbers, " --fit ")));
}

int run_calibrate(const CalibrateArguments& a, const Console& console) {
  if (!a.channels.empty()) return run_channels(a, console);
  if (!a.pictures.empty()) {
    check_for_pictures(a);
    return run_calibrate_pictures({a.pictures, a.indenter.ball, a.pixel, a.output, a.overwrite},
                                  console);
  }
  check_arguments(a);
  TextOutput output(a.output, a.overwrite);
  const Fitted fitted = read_fitted(a);
  const PressTableSensor sensor{fitted.layout.name(), fitted.points, a.columns};
  const PressRecording recording = read_press(a.recording, sensor, console);
  const std::optional<PressRecording> other =
      a.check.empty() ? std::nullopt : std::optional(read_press(a.check, sensor, console));
  check_output(a, fitted);
  if (fitted.has_table && !a.score)
    console.note(a.sensor + ": its table of pressures stays; --table N fits another");
  const CalibrationRequest request{
      .scene =
          [&](const SkinNumbers& numbers) {
            Fitted trial = fitted;
            set_numbers(numbers, 17, trial);
            return press_scene(trial.layout, a.indenter);
          },
      .start = fitted.start,
      .knots = fitted.knots,
      .numbers = a.numbers,
      .fit = !a.score && !fitted.has_table,
      .friction = a.friction,
      .depth_error = std::isnan(a.depth_error) ? std::nullopt : std::optional(a.depth_error),
      .hold_out = a.hold_out.value_or(0)};
  check_depth_error(a, recording);
  const Scene own = press_scene(fitted.own_layout, a.indenter);
  std::vector<std::string> warnings = press_warnings(own, recording);
  warn(warnings, 0, a.recording, console);
  const Calibration found = calibrate(request, recording);
  Written written = written_layout(fitted, a, found, recording);
  CalibrationReport report{.found = found,
                           .own = fitted.own,
                           .per_area = fitted.per_area,
                           .knots = fitted.knots,
                           .points = recording.points,
                           .written = written.error,
                           .other = {},
                           .beside = beside_text(found),
                           .warnings = {}};
  const std::size_t said = warnings.size();
  const Scene skin = press_scene(written.layout, a.indenter);
  std::ranges::copy(skin_warnings(skin, own, recording), std::back_inserter(warnings));
  if (is_fitted(found, kFriction))
    std::ranges::copy(friction_warnings(skin), std::back_inserter(warnings));
  if (is_fitted(found, kRelaxation) || is_fitted(found, kShear) || is_fitted(found, kFriction))
    std::ranges::copy(
        rate_warnings(skin, recording, !std::isnan(a.depth_error) || found.depth_error.estimated),
        std::back_inserter(warnings));
  for (const std::string& misfit : {misfit_text(found), shear_misfit_text(found)})
    if (!misfit.empty()) warnings.push_back(misfit);
  if (const std::string level = level_text(skin); fitted.knots > 0 && !level.empty())
    warnings.push_back(level);
  warn(warnings, said, a.recording, console);
  report.warnings = warnings;
  if (other) report.other = check_calibration(request, found.found, *other);
  console.print(report_text(report));
  const bool changed = add_remarks(fitted, found, a.recording, written),
             nothing = !changed && fits_layout(a, request.fit);
  if (nothing)
    console.note(fmt::format(
        "{}: nothing of the layout could be fitted{}; {}", a.recording, untold_text(found),
        a.output.empty() ? "it stays as it is" : a.output + " is not written"));
  else
    output.write(written.layout.text(), console);
  if (!nothing) report.output = a.output;
  report.exit_code = found.converged && !nothing ? kDone : kSomeFailed;
  report_json(report, console);
  return report.exit_code;
}

}  // namespace

Command add_calibrate(CLI::App& program) {
  const auto arguments = std::make_shared<CalibrateArguments>();
  const auto console = std::make_shared<Console>();
  CalibrateArguments& a = *arguments;
  CLI::App& app = add_command(program, "calibrate", "Fit a sensor's layout to a recorded press",
                              "tangere calibrate press.csv --sensor gelsight_mini_measured --ball "
                              "0.0075 -o my_gel_measured.xml");
  add_text(app, "RECORDING", a.recording, "",
           "Table (CSV) with a header: depth and force, or in its place a field with forces of "
           "each point; "
           "if recorded time, shear and shear_force, and beside a field x and y");
  add_text(app, "--sensor", a.sensor, "LAYOUT",
           "Layout of the sensor, whose skin faces z: a file, or one of the program's");
  add_text(app, "--pictures", a.pictures, "FOLDER",
           "Fit a camera gel to photographs of a ball that presses it: background.png, presses.csv "
           "(file, x_px, y_px, radius_px) and the files that it names; with --ball and --pixel");
  add_text(app, "--channels", a.channels, "FILE.xml",
           "Fit what the hardware returns to a table with columns channel_NAME, depth, and x and y "
           "or shear; write the map from the sensor's field to the channels");
  add_positive_numbers(app, "--nodes", a.nodes, 2,
                       "With --channels: rows and columns of nodes whose loads channels follow "
                       "[default: 3,3]");
  add_text(app, "--loads", a.loads, "NAME",
           "With --channels: of a node, pressure or force, with those along the skin [default: "
           "force if the table has shear]");
  add_text(app, "--unit", a.unit, "NAME", "With --channels: their unit [default: 1]");
  add_number(app, "--zero", a.zero,
             "With --channels: length that is added to every depth [m] [default: 0]");
  add_positive_number(app, "--pixel", a.pixel, "Side of a pixel of the photographs [m]");
  add_text(app, "-o,--output", a.output, "FILE.xml",
           "Layout to write, with the fitted attributes or channels; of --pictures the gel file");
  add_positive_number(app, "--ball", a.indenter.ball, "Radius of a ball that presses [m]");
  add_positive_number(app, "--flat", a.indenter.flat,
                      "Radius of a flat, round end that presses [m]");
  add_positive_numbers(app, "--box", a.indenter.box, 2,
                       "Sides along x and y of a flat, rectangular end that presses [m]");
  add_whole_number<int>(app, "--table", a.table, 1, kMostKnots,
                        "Fit a table of N pressures by depth in place of modulus or kn");
  add_texts(app, "--fit", a.numbers, "NAME",
            "Fit this number and no others but those named so: modulus, kn or pressure (the "
            "table), zero (of the depth), force_zero (of the load cell), x_zero and y_zero (of the "
            "place, of a field), relaxation, ks, mu, lag (of the force), slider (beside the skin) "
            "[default: all but the last two that the recording tells, and force_zero if rows are "
            "above the skin]");
  add_texts(
      app, "--column", a.columns, "NAME=COLUMN",
      "Column of the table that is depth, time, force, shear, shear_force, x or y, or the text "
      "before the / of those of a field, in SI or behind a factor: depth=-1*q/press, field=pad");
  add_positive_number(
      app, "--hold-out", a.hold_out,
      "Rows that are compared and not fitted: how many, or a share below 1 [default: "
      "none; of --channels 0.2]");
  add_text(app, "--check", a.check, "OTHER.csv",
           "Another recording, whose normal forces or channels are compared with those of the fit");
  add_flag(
      app, "--friction", a.friction,
      "Compute the normal force of a press with the layout's friction: mu, ks and kt; that of a "
      "shear has it");
  add_number(
      app, "--depth-error", a.depth_error,
      "Standard deviation of the errors of recorded depths [m], which intervals then contain; "
      "0: none [default: estimated where the recording tells it]");
  add_flag(app, "--score", a.score,
           "Fit nothing: compare the layout as it is. So is one with a table, without --table");
  add_overwrite_option(app, a.overwrite);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return run_calibrate(*arguments, *console); }};
}

}  // namespace tangere::apps
