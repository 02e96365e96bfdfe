// SPDX-License-Identifier: Apache-2.0
// tangere calibrate: fits a sensor's layout to a recorded press.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <filesystem>

#include "apps/arguments.hpp"
#include "apps/calibrate_report.hpp"
#include "apps/command.hpp"
#include "apps/layout_text.hpp"
#include "apps/press_scene.hpp"
#include "apps/press_table.hpp"
#include "apps/run_options.hpp"
#include "apps/text_output.hpp"
#include "engine/base/error.hpp"

namespace tangere::apps {
namespace {

constexpr double kUsualFriction = 0.6, kUsualShearShare = 0.4;  // where the layout has none

struct CalibrateArguments {
  std::string recording, sensor, output;
  std::vector<std::string> numbers;
  Indenter indenter;
  std::optional<double> hold_out;
  bool overwrite = false;
};

void check_arguments(const CalibrateArguments& a) {
  if (a.indenter.ball.has_value() == a.indenter.flat.has_value())
    throw InputError("expected one of --ball and --flat: the indenter");
  if (a.hold_out && *a.hold_out >= 1 && *a.hold_out != std::floor(*a.hold_out))
    throw InputError(fmt::format(
        "--hold-out {}; expected a number of rows, or a share of them below 1", *a.hold_out));
}

bool is_by_area(const Scene& scene) { return scene.sensors[0].cell > 0; }

/// The attributes that can be fitted, as the layout has them.
SkinAttributes attributes_at_start(const LayoutFile& layout, const Scene& scene) {
  const TactileDescription& d = scene.sensors[0];
  const double area = is_by_area(scene) ? d.cell : 1, kn = d.coefficients.kn / area,
               ks = d.coefficients.ks / area, mu = d.coefficients.mu;
  SkinAttributes start;
  if (d.layer || (d.material && !layout.has("kn")))
    start["modulus"] = d.material ? d.material->modulus : 1;
  else
    start["kn"] = kn > 0 ? kn : 1;
  if (d.material && (d.layer || !layout.has("damping")))
    start["relaxation"] = d.material->relaxation > 0 ? d.material->relaxation : 1e-3;
  start["ks"] = ks > 0 ? ks : kUsualShearShare * kn;
  start["mu"] = mu > 0 ? mu : kUsualFriction;
  return start;
}

/// Returns the layout with the fitted attributes. Its sensor's name says that it was measured.
std::string measured_layout(LayoutFile layout, const Calibration& found,
                            const std::string& recording) {
  for (const auto& [name, value] : found.attributes())
    layout.set(name, fmt::format("{:.5g}", value));
  std::string name = layout.name();
  if (name.ends_with("_guess")) name.resize(name.size() - 6);
  if (name.find("measured") == std::string::npos) name += "_measured";
  layout.set("name", name);
  std::vector<std::string> fitted;
  for (const auto& [number, value] : found.attributes()) fitted.push_back(number);
  layout.add_comment(fmt::format("{}: measured, fitted by 'tangere calibrate' to {}",
                                 fmt::join(fitted, ", "),
                                 std::filesystem::path(recording).filename().string()));
  return layout.text();
}

int run_calibrate(const CalibrateArguments& a, const Console& console) {
  check_arguments(a);
  const PressRecording recording = read_press(a.recording, console);
  const std::string text = layout_text("--sensor", a.sensor);
  LayoutFile layout(text, a.sensor);
  TextOutput output(a.output, a.overwrite);
  const Scene scene = press_scene(layout, a.indenter);
  CalibrationRequest request;
  request.start = attributes_at_start(layout, scene);
  request.numbers = a.numbers;
  request.hold_out = a.hold_out.value_or(0);
  request.scene = [&](const SkinAttributes& attributes) {
    for (const auto& [name, value] : attributes) layout.set(name, fmt::format("{}", value));
    return press_scene(layout, a.indenter);
  };
  const Calibration found = calibrate(request, recording);
  console.print(report_text(found, request.start, is_by_area(scene)));
  output.write(measured_layout(LayoutFile(text, a.sensor), found, a.recording), console);
  report_json(found, console);
  return found.converged ? kDone : kSomeFailed;
}

}  // namespace

Command add_calibrate(CLI::App& program) {
  const auto arguments = std::make_shared<CalibrateArguments>();
  const auto console = std::make_shared<Console>();
  CalibrateArguments& a = *arguments;
  CLI::App& app = add_command(program, "calibrate", "Fit a sensor's layout to a recorded press",
                              "tangere calibrate press.csv --sensor gelsight_mini_measured --ball "
                              "0.0075 -o my_gel_measured.xml");
  add_text(
      app, "RECORDING", a.recording, "",
      "Table (CSV) with a header: depth and force, and if recorded time, shear and shear_force")
      .required();
  add_text(app, "--sensor", a.sensor, "LAYOUT",
           "Layout of the sensor, whose skin faces z: a file, or one of the program's")
      .required();
  add_text(app, "-o,--output", a.output, "FILE.xml", "Layout to write, with the fitted attributes");
  add_positive_number(app, "--ball", a.indenter.ball, "Radius of a ball that presses [m]");
  add_positive_number(app, "--flat", a.indenter.flat,
                      "Radius of a flat, round end that presses [m]");
  add_texts(app, "--fit", a.numbers, "NAME",
            "Fit this number and no others but those named so: modulus or kn, zero (of the depth), "
            "relaxation, ks, mu [default: all that the recording tells]");
  add_positive_number(app, "--hold-out", a.hold_out,
                      "Rows that are compared and not fitted: how many, or a share below 1");
  add_overwrite_option(app, a.overwrite);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return run_calibrate(*arguments, *console); }};
}

}  // namespace tangere::apps
