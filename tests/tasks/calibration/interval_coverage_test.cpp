// SPDX-License-Identifier: Apache-2.0
// Of many recordings with noise of their own, the 95 % intervals of nearly all contain the numbers
// that made them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <random>

#include "io/scene/scene_reader.hpp"
#include "tasks/calibration/calibration.hpp"

namespace tangere {
namespace {

constexpr double kGelModulus = 2e5, kGelTau = 0.02, kGelZero = 2.3e-5;
constexpr int kRecordings = 40;

/// A ball of 4 mm above 11 x 11 points of a gel whose layer has 6 x 6 cells.
Scene gel_press(const SkinNumbers& numbers, double relaxation) {
  const auto number = [&](const char* name, double otherwise) {
    return numbers.contains(name) ? numbers.at(name) : otherwise;
  };
  const std::string text =
      "<tangere model=\"press\"><option unit=\"m-kg\" gravity=\"0 0 0\" timestep=\"1\"/><robot>"
      "<link name=\"c\"><joint name=\"c\" type=\"fixed\"/><body name=\"c\" type=\"cuboid\" "
      "size=\"0.01 0.01 0.01\"/></link></robot><robot><link name=\"b\"><joint name=\"b\" "
      "type=\"translational\"/><body name=\"b\" type=\"sphere\" radius=\"0.004\" pos=\"0 0 "
      "0.004\"/>"
      "</link></robot><actuator><motor joint=\"b\" ctrl=\"position\" P=\"1e9\"/></actuator>"
      "<sensor><tactile name=\"skin\" body=\"c\" type=\"rect_array\" resolution=\"11 11\" "
      "rect_pos0=\"-0.003 0.003 0\" rect_pos1=\"0.003 -0.003 0\" axis0=\"0 -1 0\" axis1=\"1 0 0\" "
      "pressure_sign=\"1\" thickness=\"2e-3\" mu=\"0.6\" modulus=\"" +
      fmt::format("{:.17g}", number("modulus", 1e5)) + "\" relaxation=\"" +
      fmt::format("{:.17g}", number("relaxation", relaxation)) +
      "\"><layer/></tactile></sensor></tangere>";
  return placed_indenter(parse_scene(text, "press.xml").scene);
}

/// In by 0.4 mm and out.
PressRecording gel_path() {
  PressRecording out;
  for (int k = 0; k < 40; ++k) {
    out.time.push_back(5e-3 * k);
    out.depth.push_back(2e-5 * (k <= 20 ? k : 40 - k));
  }
  return out;
}

TEST(IntervalCoverage, OfALayerWithRelaxation) {
  const char* n = std::getenv("RECS");
  const int recs = n ? std::atoi(n) : kRecordings;
  const char* nn = std::getenv("NOISE");
  const double noise = nn ? std::atof(nn) : 0.01;
  const char* tt = std::getenv("TAU");
  const double tau = tt ? std::atof(tt) : kGelTau;
  const SkinNumbers truth{{"modulus", kGelModulus}, {"relaxation", tau}, {"zero", kGelZero}};
  CalibrationRequest request;
  request.scene = [](const SkinNumbers& numbers) { return gel_press(numbers, 0); };
  request.start = {{"modulus", 1e5}, {"relaxation", 5e-3}};
  PressRecording r = gel_path();
  std::vector<double> depth = r.depth;
  for (double& d : depth) d += kGelZero;
  PressRecording moved = r;
  moved.depth = depth;
  const std::vector<double> rate = moved.rates();
  const std::vector<double> exact = press_forces(
      request.scene(truth), {.depth = depth, .rate = rate, .time = {}, .x = {}, .y = {}});
  const double peak = *std::max_element(exact.begin(), exact.end());
  std::map<std::string, int> inside;
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, noise * peak);
  for (int k = 0; k < recs; ++k) {
    r.force = exact;
    for (double& f : r.force) f += normal(random);
    const Calibration found = calibrate(request, r);
    for (const FittedNumber& x : found.numbers) {
      inside[x.name] += truth.at(x.name) >= x.low && truth.at(x.name) <= x.high;
      fmt::print("{} {:.5g} [{:.5g} {:.5g}]  ", x.name, x.value, x.low, x.high);
    }
    fmt::print("{}\n", found.normal.root_mean_square);
  }
  for (const auto& [name, count] : inside) {
    fmt::print("{} {} of {}\n", name, count, recs);
    EXPECT_GE(count, 0.85 * recs) << name;
  }
}

}  // namespace
}  // namespace tangere
