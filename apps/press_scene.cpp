// SPDX-License-Identifier: Apache-2.0
// The scene is a text, so that the sensor means what it means in every scene.
#include "apps/press_scene.hpp"

#include <fmt/format.h>

#include "io/scene/scene_reader.hpp"
#include "tasks/calibration/press.hpp"

namespace tangere::apps {
namespace {

const std::vector<std::string> kLeftOut = {"imperfections", "markers", "feedback", "memory",
                                           "every",         "feels",   "ignores",  "channels"};

std::string shape_text(const Indenter& of) {
  constexpr double kLength = 0.1;
  if (of.ball) return fmt::format("type=\"sphere\" radius=\"{0}\" pos=\"0 0 {0}\"", *of.ball);
  if (!of.box.empty())
    return fmt::format("type=\"cuboid\" size=\"{} {} {}\" pos=\"0 0 {}\"", of.box[0], of.box[1],
                       kLength, kLength / 2);
  return fmt::format("type=\"cylinder\" radius=\"{}\" length=\"{}\" pos=\"0 0 {}\"", *of.flat,
                     kLength, kLength / 2);
}

}  // namespace

Scene press_scene(const LayoutFile& layout, const Indenter& indenter) {
  const std::string text = fmt::format(
      "<tangere model=\"press\"><option unit=\"m-kg\" gravity=\"0 0 0\" timestep=\"1\"/>"
      "<robot><link name=\"carrier\"><joint name=\"carrier\" type=\"fixed\"/><body "
      "name=\"carrier\" "
      "type=\"cuboid\" size=\"0.01 0.01 0.01\"/></link></robot>"
      "<robot><link name=\"indenter\"><joint name=\"indenter\" type=\"translational\"/>"
      "<body name=\"indenter\" {}/></link></robot>"
      "<actuator><motor joint=\"indenter\" ctrl=\"position\" P=\"1e9\"/></actuator>"
      "<sensor>{}</sensor></tangere>",
      shape_text(indenter), layout.tactile_text("carrier", kLeftOut));
  SceneReadOptions options;
  options.origins = {layout.source()};
  return placed_indenter(parse_scene(text, layout.source().file, options).scene);
}

}  // namespace tangere::apps
