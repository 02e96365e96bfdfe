// SPDX-License-Identifier: Apache-2.0
// tangere import: makes a scene of a robot's URDF or MJCF file.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/layout_text.hpp"
#include "apps/run_options.hpp"
#include "apps/task_run.hpp"
#include "io/files/part_file.hpp"
#include "io/robot/robot_import.hpp"
#include "io/robot/rotations.hpp"

namespace tangere::apps {
namespace {

struct ImportArguments {
  std::string robot, output, base, keyframe;
  std::vector<std::string> pads, motors, contacts, end_effectors;
  bool drop = false, allow_unknown = false, overwrite = false;
};

/// Splits "A=B" at the first '='.
std::pair<std::string, std::string> split(const std::string& option, const std::string& text,
                                          const char* form) {
  const std::size_t at = text.find('=');
  if (at == 0 || at == std::string::npos || at + 1 == text.size())
    throw InputError(fmt::format("{} {}: expected {}", option, text, form));
  return {text.substr(0, at), text.substr(at + 1)};
}

/// Reads numbers separated by commas.
std::vector<double> numbers_of(const std::string& what, const std::string& text) {
  std::vector<double> out;
  const char* p = text.data();
  const char* const end = p + text.size();
  for (;;) {
    double x = 0;
    const auto [next, error] = std::from_chars(p, end, x);
    if (error != std::errc() || !std::isfinite(x) || (next != end && *next != ','))
      throw InputError(fmt::format("{}: '{}'; expected numbers separated by commas", what, text));
    out.push_back(x);
    if (next == end) return out;
    p = next + 1;
  }
}

PadRequest read_pad(const std::string& text) {
  const auto [link, rest] = split("--pad", text,
                                  "LINK=LAYOUT, LINK=LAYOUT@+x or "
                                  "LINK=LAYOUT@x,y,z,roll,pitch,yaw");
  PadRequest pad;
  pad.link = link;
  const std::size_t at = rest.rfind('@');
  pad.layout_name = rest.substr(0, at);
  pad.layout = layout_text("--pad " + text, pad.layout_name);
  if (at == std::string::npos) return pad;
  const std::string place = rest.substr(at + 1);
  if (place.size() == 2 && place.find_first_of("xyz") == 1) {
    pad.face = place;
    return pad;
  }
  const std::vector<double> x = numbers_of("--pad " + text, place);
  if (x.size() != 3 && x.size() != 6)
    throw InputError(
        fmt::format("--pad {}: {} numbers behind '@'; expected x,y,z [m] or "
                    "x,y,z,roll,pitch,yaw [m, rad]",
                    text, x.size()));
  pad.pose.position = {x[0], x[1], x[2]};
  if (x.size() == 6) pad.pose.orientation = from_rpy({x[3], x[4], x[5]});
  return pad;
}

MotorRequest read_motor(const std::string& text) {
  const auto [joint, law] = split("--motor", text, "JOINT=force or JOINT=P,D");
  MotorRequest motor{joint};
  if (law == "force") return motor;
  const std::vector<double> gains = numbers_of("--motor " + text, law);
  if (gains.size() > 2 || !(gains[0] > 0) || !(gains.back() >= 0))
    throw InputError(
        fmt::format("--motor {}: expected force, or a gain P above 0 and a gain D", text));
  motor.P = gains[0];
  if (gains.size() == 2) motor.D = gains[1];
  return motor;
}

RobotOptions options_of(const ImportArguments& given) {
  RobotOptions options;
  options.allow_unknown = given.allow_unknown;
  if (!given.base.empty() && given.base != "fixed" && given.base != "free")
    throw InputError("--base " + given.base + ": expected fixed or free");
  options.free_base = given.base == "free";
  for (const std::string& text : given.pads) options.pads.push_back(read_pad(text));
  for (const std::string& text : given.motors) options.motors.push_back(read_motor(text));
  for (const std::string& text : given.contacts) {
    const auto [first, second] = split("--contact", text, "LINK=LINK or LINK=ground");
    options.touches.push_back({first, second});
  }
  options.end_effectors = given.end_effectors;
  options.keyframe = given.keyframe;
  return options;
}

std::string listed(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += "\n  " + line;
  return text;
}

int run_import(const ImportArguments& given, const Console& console) {
  const ImportedScene scene = import_robot(given.robot, given.output, options_of(given));
  if (!scene.lost.empty() && !given.drop)
    throw InputError(fmt::format(
        "{}: scenes cannot say this, and the motion differs without it:{}\n--drop leaves it out",
        given.robot, listed(scene.lost)));
  write_text_atomically(given.output, scene.text, given.overwrite);
  for (const std::string& warning : scene.warnings) console.note("warning: " + warning);
  if (!scene.lost.empty())
    console.note("left out, and the motion differs by it:" + listed(scene.lost));
  if (!scene.changed.empty()) console.note("said in another way:" + listed(scene.changed));
  if (!scene.idle.empty())
    console.note("left out, and of no effect on the motion:" + listed(scene.idle));
  console.print(fmt::format(
      "wrote {}: {} links, {} joints that move, {} motors, {} skins{}", given.output, scene.links,
      scene.joints, scene.motors, scene.sensors,
      scene.end_effectors == 0 ? "" : fmt::format(", {} end effectors", scene.end_effectors)));
  console.result({{"command", "import"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"input", given.robot},
                  {"output", given.output},
                  {"format", scene.format},
                  {"links", scene.links},
                  {"joints", scene.joints},
                  {"motors", scene.motors},
                  {"sensors", scene.sensors},
                  {"end_effectors", scene.end_effectors},
                  {"lost", scene.lost},
                  {"changed", scene.changed},
                  {"idle", scene.idle},
                  {"warnings", scene.warnings}});
  return kDone;
}

}  // namespace

Command add_import(CLI::App& program) {
  const auto options = std::make_shared<ImportArguments>();
  const auto console = std::make_shared<Console>();
  ImportArguments& o = *options;
  CLI::App& app = add_command(program, "import", "Make a scene of a robot's URDF or MJCF file",
                              "tangere import gripper.urdf -o gripper.xml --pad "
                              "left_finger=gelsight_mini_measured@+y --motor left_slide=400,20");
  add_text(app, "ROBOT", o.robot, "", "URDF file (root <robot>) or MJCF file (root <mujoco>)")
      .required();
  add_text(app, "-o,--output", o.output, "SCENE.xml",
           "Scene to write. Meshes are named relative to it.")
      .required();
  add_texts(app, "--pad", o.pads, "LINK=LAYOUT",
            fmt::format("Put a skin on a link, or at a site of MJCF: {} or a file. @+x to @-z "
                        "behind it puts it on a face of the link's box, @x,y,z or "
                        "@x,y,z,roll,pitch,yaw there in the link's frame [m, rad].",
                        fmt::join(program_sensors(), ", ")));
  add_texts(app, "--motor", o.motors, "JOINT=force|P,D",
            "Drive a joint by force within the file's effort, or towards targets with gains P and "
            "D, within the effort if there is one");
  add_texts(app, "--contact", o.contacts, "LINK=LINK|ground",
            "Let the shapes of two links touch, or those of one the ground");
  add_texts(app, "--end-effector", o.end_effectors, "LINK|SITE",
            "Store where a link, or a site of MJCF, is");
  add_text(app, "--keyframe", o.keyframe, "NAME",
           "Of MJCF: start from this keyframe, with its controls; a name, or a number from 0");
  add_text(app, "--base", o.base, "fixed|free",
           "Whether the root link of URDF, or bodies of MJCF's world without joints, stand in the "
           "world or move freely [default: fixed]");
  add_flag(app, "--drop", o.drop,
           "Leave out what changes the motion and scenes cannot say, which else is an error");
  add_allow_unknown_option(app, o.allow_unknown);
  add_overwrite_option(app, o.overwrite);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return run_import(*options, *console); }};
}

}  // namespace tangere::apps
