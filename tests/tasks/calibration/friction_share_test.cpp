// SPDX-License-Identifier: Apache-2.0
// A press that is made with friction by steps of a motor, and fitted without: what friction moves
// is what the fit says.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/base/error.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/calibration/calibration.hpp"

namespace tangere {
namespace {

constexpr double kTrueModulus = 2e5, kTrueTau = 0.02, kRowTime = 5e-3;

std::string press_text(double modulus, double relaxation, double timestep) {
  return "<tangere model=\"press\"><option unit=\"m-kg\" gravity=\"0 0 0\" timestep=\"" +
         fmt::format("{:.17g}", timestep) +
         "\"/><robot><link name=\"c\"><joint name=\"c\" type=\"fixed\"/><body name=\"c\" "
         "type=\"cuboid\" size=\"0.01 0.01 0.01\"/></link></robot><robot><link name=\"b\"><joint "
         "name=\"b\" type=\"translational\"/><body name=\"b\" type=\"sphere\" radius=\"0.004\" "
         "pos=\"0 0 0.004\"/></link></robot><actuator><motor joint=\"b\" ctrl=\"position\" "
         "P=\"1e9\"/></actuator><sensor><tactile name=\"skin\" body=\"c\" type=\"rect_array\" "
         "resolution=\"17 17\" rect_pos0=\"-0.003 0.003 0\" rect_pos1=\"0.003 -0.003 0\" "
         "axis0=\"0 -1 0\" axis1=\"1 0 0\" pressure_sign=\"1\" thickness=\"2e-3\" mu=\"0.6\" "
         "modulus=\"" +
         fmt::format("{:.17g}", modulus) + "\" relaxation=\"" + fmt::format("{:.17g}", relaxation) +
         "\"/></sensor></tangere>";
}

/// A press in and out, stepped as the scene says.
PressRecording stepped_press() {
  const Model model(parse_scene(press_text(kTrueModulus, kTrueTau, kRowTime), "press.xml").scene);
  Stepper stepper(model);
  Batch batch(model, 1);
  Readout readout(model);
  batch.set_state(0, std::array<double, 3>{0, 0, -1e-5}, std::array<double, 3>{});
  PressRecording out;
  for (int k = 1; k < 80; ++k) {
    const double depth = 1e-5 * (k <= 40 ? k : 80 - k) + 1e-5;
    stepper.step(batch, std::array<double, 3>{0, 0, -depth});
    std::array<double, 6> sum{};
    std::span<double> reading = sum;
    readout.read_block(batch, 0, FieldOutput{0, FieldForm::sum}, {&reading, 1});
    out.time.push_back(kRowTime * k);
    out.depth.push_back(depth);
    out.force.push_back(-sum[2]);
  }
  return out;
}

CalibrationRequest press_request() {
  CalibrationRequest request;
  request.scene = [](const SkinNumbers& numbers) {
    const auto number = [&](const char* name, double otherwise) {
      return numbers.contains(name) ? numbers.at(name) : otherwise;
    };
    return placed_indenter(
        parse_scene(press_text(number("modulus", 1e5), number("relaxation", 5e-3), 1), "press.xml")
            .scene);
  };
  request.start = {{"modulus", 1e5}, {"relaxation", 5e-3}};
  return request;
}

const std::array kPressTruth{kTrueModulus, 0.0, kTrueTau};

TEST(FrictionShare, SaysHowFarFrictionMovesTheNumbers) {
  const Calibration found = calibrate(press_request(), stepped_press());
  EXPECT_EQ(found.friction.mu, 0.6);
  EXPECT_GT(found.friction.largest, 0.02);
  ASSERT_EQ(found.friction.moved.size(), 3U);
  for (std::size_t k = 0; k < kPressTruth.size(); ++k) {
    const FittedNumber& number = found.numbers[k];
    const double off = number.value - kPressTruth[k], said = -found.friction.moved[k].value;
    EXPECT_TRUE(kPressTruth[k] < number.low || kPressTruth[k] > number.high)
        << number.name << " is beyond its interval without friction";
    EXPECT_NEAR(off, said, 0.25 * std::abs(off)) << number.name << " " << number.value;
  }
}

TEST(FrictionShare, AFitWithFrictionFindsTheNumbers) {
  CalibrationRequest request = press_request();
  request.friction = true;
  const Calibration found = calibrate(request, stepped_press());
  EXPECT_NEAR(found.numbers[0].value, kTrueModulus, 2e-3 * kTrueModulus);
  EXPECT_NEAR(found.numbers[1].value, 0, 5e-8);
  EXPECT_NEAR(found.numbers[2].value, kTrueTau, 2e-3 * kTrueTau);
  EXPECT_LT(found.normal.largest, 2e-3);
  EXPECT_TRUE(found.friction.moved.empty());
}

/// The rim of a contact slips and its middle sticks. Fits that begin with a slip of all points end
/// elsewhere.
TEST(FrictionShare, AShearThatSlipsAtTheRimIsFound) {
  CalibrationRequest request = press_request();
  request.scene = [](const SkinNumbers& numbers) {
    Scene scene = parse_scene(press_text(1e5, 0, 1), "press.xml").scene;
    ContactCoefficients& c = scene.sensors[0].coefficients;
    for (const auto& [name, value] : numbers)
      (name == "ks" ? c.ks : name == "mu" ? c.mu : c.kn) = name == "zero" ? c.kn : value;
    return placed_indenter(scene);
  };
  const SkinNumbers truth{{"kn", 1.5e8}, {"ks", 6e7}, {"mu", 0.6}};
  request.start = {{"kn", 1e8}, {"ks", 4e7}, {"mu", 1}};
  request.numbers = {"kn", "ks", "mu"};
  PressRecording r;
  for (int k = 1; k <= 10; ++k) r.depth.push_back(5e-5 * k), r.shear.push_back(0);
  for (int k = 1; k <= 10; ++k) r.depth.push_back(5e-4), r.shear.push_back(1.5e-5 * k);
  const PressPath path{.depth = r.depth, .rate = {}, .time = {}, .x = r.shear, .y = {}};
  const PathForces forces = path_forces(request.scene(truth), path);
  r.force = forces.normal, r.shear_force = forces.tangential;
  const Calibration found = calibrate(request, r);
  for (const auto& [name, value] : truth)
    EXPECT_NEAR(found.found.at(name), value, 1e-3 * value) << name;
}

}  // namespace
}  // namespace tangere
