// SPDX-License-Identifier: Apache-2.0
// tangere plot: draws tactile fields of a trajectory file, or a scene at its start.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "io/files/part_file.hpp"
#include "io/picture/scene_plot.hpp"
#include "io/picture/tactile_plot.hpp"

namespace tangere::apps {
namespace {

constexpr int kMostFrames = 1000;  // in a strip; each is a panel of its own

struct PlotArguments {
  std::string input, output, sensor;
  std::optional<std::int64_t> environment, frame;
  std::optional<int> strip, turn, lift;
  bool overwrite = false;
};

bool is_scene(const std::string& path) { return std::filesystem::path(path).extension() == ".xml"; }

/// Refuses options of the other kind of picture.
void check_arguments(const PlotArguments& options) {
  const bool field_options =
                 !options.sensor.empty() || options.environment || options.frame || options.strip,
             scene_options = options.turn || options.lift;
  if (is_scene(options.input) && field_options)
    throw InputError("--sensor, --env, --frame and --strip with a scene; expected a trajectory");
  if (!is_scene(options.input) && scene_options)
    throw InputError("--turn or --lift with a trajectory; expected a scene, F.xml");
}

int plot_scene(const PlotArguments& options, const Console& console) {
  const Scene scene = read_scene_for(options.input, false, console);
  SceneCamera camera;
  if (options.turn) camera.turn = *options.turn;
  if (options.lift) camera.lift = *options.lift;
  const std::string svg = render_scene_svg(scene, camera);
  write_text_atomically(options.output, svg, options.overwrite);
  console.print(
      fmt::format("wrote {} ({} bytes): the scene at its start", options.output, svg.size()));
  console.result({{"command", "plot"},
                  {"exit_code", 0},
                  {"input", options.input},
                  {"output", options.output},
                  {"bytes", svg.size()},
                  {"turn", camera.turn},
                  {"lift", camera.lift}});
  return kDone;
}

int plot(const PlotArguments& options, const Console& console) {
  check_arguments(options);
  if (is_scene(options.input)) return plot_scene(options, console);
  PlotOptions what;
  what.sensor = options.sensor;
  what.environment = options.environment.value_or(0);
  what.frame = options.frame;
  what.strip = options.strip.value_or(what.strip);
  const TrajectoryReader file(options.input);
  const std::string svg = render_tactile_svg(file, what);
  write_text_atomically(options.output, svg, options.overwrite);
  const std::vector<std::string> drawable = drawable_sensors(file);
  const std::string& sensor = what.sensor.empty() ? drawable.at(0) : what.sensor;
  console.print(fmt::format("wrote {} ({} bytes): sensor {}, environment {}", options.output,
                            svg.size(), sensor, what.environment));
  if (drawable.size() > 1)
    console.note(fmt::format("sensors that can be drawn: {}", fmt::join(drawable, ", ")));
  console.result({{"command", "plot"},
                  {"exit_code", 0},
                  {"input", options.input},
                  {"output", options.output},
                  {"bytes", svg.size()},
                  {"sensor", sensor},
                  {"sensors", drawable},
                  {"environment", what.environment},
                  {"frame", what.frame ? Json(*what.frame) : Json()}});
  return kDone;
}

}  // namespace

Command add_plot(CLI::App& program) {
  const auto options = std::make_shared<PlotArguments>();
  const auto console = std::make_shared<Console>();
  PlotArguments& o = *options;
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  CLI::App& app =
      add_command(program, "plot", "Draw tactile fields of a trajectory, or a scene, as SVG",
                  "tangere plot ball.h5 -o ball.svg --sensor pad --env 2 --strip 4");
  add_text(app, "FILE", o.input, "",
           "HDF5 file written by 'tangere simulate', or a scene file F.xml")
      .required();
  add_text(app, "-o,--output", o.output, "F.svg", "SVG file to write").required();
  add_overwrite_option(app, o.overwrite);
  start_group(app, "Of a trajectory");
  add_text(app, "--sensor", o.sensor, "NAME",
           "Tactile sensor: a rectangular array, or a curved pad whose points have pixels "
           "[default: the first of them by name]");
  add_whole_number<std::int64_t>(app, "--env", o.environment, 0, kMost,
                                 "Environment, counted from 0 [default: 0]");
  const AddedOption frame = add_whole_number<std::int64_t>(app, "--frame", o.frame, 0, kMost,
                                                           "One field, counted from 0");
  add_whole_number<int>(app, "--strip", o.strip, 1, kMostFrames,
                        "Most fields in a row, spread over those with contact [default: 6]")
      .excludes(frame);
  start_group(app, "Of a scene");
  add_whole_number<int>(
      app, "--turn", o.turn, -360, 360,
      "Degrees about z from which it is seen; at 0 x is right and y away [default: 30]");
  add_whole_number<int>(app, "--lift", o.lift, -90, 90,
                        "Degrees above the horizon from which it is seen [default: 25]");
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return plot(*options, *console); }, [] { return true; }};
}

}  // namespace tangere::apps
