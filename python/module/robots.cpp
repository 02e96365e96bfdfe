// SPDX-License-Identifier: Apache-2.0
// Robots in Python: a URDF or MJCF file as the text of a scene.
#include <fmt/format.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "engine/base/error.hpp"
#include "io/robot/robot_import.hpp"
#include "io/robot/rotations.hpp"
#include "python/module/module.hpp"

namespace tangere::python {
namespace nb = nanobind;
namespace {

using nb::literals::operator""_a;

/// Link, name and text of the layout, face, and instead x y z roll pitch yaw.
using Pad = std::tuple<std::string, std::string, std::string, std::string, std::array<double, 6>>;
/// Joint and gains: P D, or none of a force motor.
using Motor = std::pair<std::string, std::vector<double>>;

PadRequest pad_of(const Pad& given) {
  const auto& [link, name, layout, face, x] = given;
  return {link, name, layout, {{x[0], x[1], x[2]}, from_rpy({x[3], x[4], x[5]})}, face};
}

MotorRequest motor_of(const Motor& given) {
  const auto& [joint, gains] = given;
  if (gains.empty()) return {joint};
  if (gains.size() > 2 || !(gains[0] > 0) || !(gains.back() >= 0))
    throw InputError(
        fmt::format("motor of '{}': expected \"force\", or a gain P above 0 and a gain D", joint));
  return {joint, gains[0], gains.size() == 2 ? gains[1] : 0};
}

}  // namespace

void add_robots(nb::module_& m) {
  m.def(
      "robot_scene",
      [](const std::filesystem::path& path, const std::filesystem::path& output,
         const std::vector<Pad>& pads, const std::vector<Motor>& motors,
         const std::vector<std::pair<std::string, std::string>>& contacts,
         const std::vector<std::string>& end_effectors, const std::string& keyframe, bool free_base,
         bool allow_unknown) {
        RobotOptions options;
        options.allow_unknown = allow_unknown;
        options.free_base = free_base;
        for (const Pad& pad : pads) options.pads.push_back(pad_of(pad));
        for (const Motor& motor : motors) options.motors.push_back(motor_of(motor));
        for (const auto& [first, second] : contacts) options.touches.push_back({first, second});
        options.end_effectors = end_effectors;
        options.keyframe = keyframe;
        ImportedScene scene = import_robot(path, output, options);
        return std::make_tuple(std::move(scene.text), std::move(scene.lost),
                               std::move(scene.changed), std::move(scene.warnings));
      },
      "path"_a, "output"_a, "pads"_a, "motors"_a, "contacts"_a, "end_effectors"_a, "keyframe"_a,
      "free_base"_a, "allow_unknown"_a,
      "A robot's file as the text of a scene that lies at `output`, with what is left out "
      "although\n"
      "it changes the motion, what is expressed differently, and warnings.");
}

}  // namespace tangere::python
