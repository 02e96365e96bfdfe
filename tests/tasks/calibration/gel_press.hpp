// SPDX-License-Identifier: Apache-2.0
// A ball above a small gel, for tests of fits.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "io/scene/scene_reader.hpp"
#include "tasks/calibration/calibration.hpp"

namespace tangere::testing {

/// A ball of 4 mm above 6 x 6 points, 0.6 mm apart, of a gel of 2 mm, with 3 x 3 cells. The numbers
/// are attributes of the sensor.
inline Scene gel_press(SkinNumbers numbers, bool layer) {
  numbers.try_emplace("modulus", 1e5);
  std::string attributes;
  for (const char* const name : {"modulus", "relaxation", "ks", "mu"})
    if (numbers.contains(name))
      attributes += fmt::format(" {}=\"{:.17g}\"", name, numbers.at(name));
  const std::string text =
      "<tangere model=\"press\"><option unit=\"m-kg\" gravity=\"0 0 0\" timestep=\"1\"/><robot>"
      "<link name=\"c\"><joint name=\"c\" type=\"fixed\"/><body name=\"c\" type=\"cuboid\" "
      "size=\"0.01 0.01 0.01\"/></link></robot><robot><link name=\"b\"><joint name=\"b\" "
      "type=\"translational\"/><body name=\"b\" type=\"sphere\" radius=\"0.004\" "
      "pos=\"0 0 0.004\"/></link></robot><actuator><motor joint=\"b\" ctrl=\"position\" "
      "P=\"1e9\"/></actuator><sensor><tactile name=\"skin\" body=\"c\" type=\"rect_array\" "
      "resolution=\"6 6\" rect_pos0=\"-0.0015 0.0015 0\" rect_pos1=\"0.0015 -0.0015 0\" "
      "axis0=\"0 -1 0\" axis1=\"1 0 0\" pressure_sign=\"1\" thickness=\"2e-3\"" +
      attributes + (layer ? "><layer cell=\"1.2e-3\"/></tactile>" : "/>") + "</sensor></tangere>";
  return placed_indenter(parse_scene(text, "press.xml").scene);
}

/// Adds errors of this deviation.
inline void add_noise(std::vector<double>& forces, double deviation, std::mt19937& random) {
  std::normal_distribution<double> noise(0, deviation);
  for (double& f : forces) f += noise(random);
}

}  // namespace tangere::testing
