// SPDX-License-Identifier: Apache-2.0
// Fields of a gel that the program computes are fitted: numbers, places and intervals.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "engine/base/error.hpp"
#include "tests/tasks/calibration/gel_press.hpp"

namespace tangere {
namespace {

using testing::add_noise;
using testing::gel_press;

constexpr std::size_t kFieldPoints = 36;

CalibrationRequest field_request(bool layer) {
  CalibrationRequest request;
  request.scene = [layer](const SkinNumbers& numbers) { return gel_press(numbers, layer); };
  request.start = {{"modulus", 1e5}};
  return request;
}

/// Presses at places, whose ball is 20 um deeper and beside by (50, -30) um.
PressRecording placed_presses(const Scene& scene, PressRecording* acting = nullptr) {
  PressRecording out, moved;
  for (int k = 0; k < 12; ++k) {
    out.depth.push_back(2e-5 * (k + 5));
    out.x.push_back(4e-4 * (k % 3 - 1)), out.y.push_back(3e-4 * (k / 3 - 1.5));
  }
  moved = out;
  for (double& d : moved.depth) d += 2e-5;
  for (double& x : moved.x) x += 5e-5;
  for (double& y : moved.y) y -= 3e-5;
  out.points = kFieldPoints;
  out.field = press_forces(
      scene,
      {.depth = moved.depth, .rate = {}, .time = {}, .x = moved.x, .y = moved.y, .fields = true});
  if (acting != nullptr) *acting = moved;
  return out;
}

const SkinNumbers kFieldTruth{
    {"modulus", 2e5}, {"zero", 2e-5}, {"x_zero", 5e-5}, {"y_zero", -3e-5}};

TEST(FieldFit, AGelAndThePlaceOfItsIndenterAreFound) {
  for (const bool layer : {false, true}) {
    const CalibrationRequest request = field_request(layer);
    const PressRecording r = placed_presses(request.scene(kFieldTruth));
    const Calibration found = calibrate(request, r);
    ASSERT_EQ(found.numbers.size(), kFieldTruth.size());
    for (const FittedNumber& number : found.numbers) {
      const double truth = kFieldTruth.at(number.name);
      EXPECT_NEAR(number.value, truth, 1e-3 * std::abs(truth)) << number.name;
    }
    EXPECT_LT(found.normal.largest, 1e-3);
    EXPECT_EQ(found.normal.rows, 12);
    EXPECT_TRUE(found.given.empty()) << "a field has no zero of a load cell";
  }
}

/// Noise of 1 % of the peak at each point, alone and with an error that the points of a row share.
TEST(FieldFit, IntervalsContainErrorsThatPointsShare) {
  constexpr int kRecordings = 20;
  const CalibrationRequest request = field_request(false);
  const PressRecording exact = placed_presses(request.scene(kFieldTruth));
  const double peak = *std::ranges::max_element(exact.field);
  for (const double shared : {0.0, 0.03}) {
    std::mt19937 random(5);
    std::normal_distribution<double> gain(0, shared);
    std::map<std::string, int> inside;
    for (int k = 0; k < kRecordings; ++k) {
      PressRecording r = exact;
      for (std::size_t row = 0; row < r.rows(); ++row) {
        const double factor = 1 + gain(random);
        for (std::size_t i = row * kFieldPoints; i < (row + 1) * kFieldPoints; ++i)
          r.field[i] *= factor;
      }
      add_noise(r.field, 0.01 * peak, random);
      for (const FittedNumber& x : calibrate(request, r).numbers)
        inside[x.name] += kFieldTruth.at(x.name) >= x.low && kFieldTruth.at(x.name) <= x.high;
    }
    ASSERT_EQ(inside.size(), kFieldTruth.size());
    for (const auto& [name, count] : inside)
      EXPECT_GE(count, 0.85 * kRecordings) << name << " with " << shared;
  }
}

/// A ball that is pressed in and moved along x until all points slip.
TEST(FieldFit, FrictionIsThatOfTheFieldAlongTheSkin) {
  const SkinNumbers truth{{"modulus", 2e5}, {"ks", 5e7}, {"mu", 0.5}};
  for (const bool layer : {false, true}) {
    CalibrationRequest request = field_request(layer);
    request.start = {{"modulus", 1e5}, {"ks", 2e7}, {"mu", 0.8}};
    request.numbers = {"modulus", "ks", "mu"};
    PressRecording r;
    for (int k = 1; k <= 5; ++k) r.depth.push_back(6e-5 * k), r.shear.push_back(0);
    for (int k = 1; k <= 10; ++k) r.depth.push_back(3e-4), r.shear.push_back(4e-5 * k);
    const PressPath path{
        .depth = r.depth, .rate = {}, .time = {}, .x = r.shear, .y = {}, .fields = true};
    r.points = kFieldPoints;
    const PathForces forces = path_forces(request.scene(truth), path);
    r.field = forces.normal, r.shear_field = forces.tangential;
    std::mt19937 random(3);
    const double peak = *std::ranges::max_element(r.field);
    add_noise(r.field, 2e-3 * peak, random), add_noise(r.shear_field, 2e-3 * peak, random);
    const Calibration found = calibrate(request, r);
    EXPECT_NEAR(found.found.at("modulus"), 2e5, 0.005 * 2e5) << layer;
    EXPECT_NEAR(found.found.at("ks"), 5e7, 0.02 * 5e7) << layer;
    EXPECT_NEAR(found.found.at("mu"), 0.5, 0.005) << layer;
    EXPECT_LT(found.shear.root_mean_square, 0.02) << layer;
    EXPECT_GT(found.friction.mu, 0) << "the friction of a sheared path is named";
  }
}

/// A skin without friction has forces along the ball's normals alone.
TEST(FieldFit, NoFrictionIsToldFromMuch) {
  CalibrationRequest request = field_request(false);
  request.start = {{"modulus", 1e5}, {"ks", 2e7}, {"mu", 0.8}};
  request.numbers = {"modulus", "ks", "mu"};
  PressRecording r;
  for (int k = 1; k <= 5; ++k) r.depth.push_back(6e-5 * k), r.shear.push_back(0);
  for (int k = 1; k <= 5; ++k) r.depth.push_back(3e-4), r.shear.push_back(8e-5 * k);
  const PressPath path{
      .depth = r.depth, .rate = {}, .time = {}, .x = r.shear, .y = {}, .fields = true};
  r.points = kFieldPoints;
  const Scene scene = request.scene({{"modulus", 2e5}, {"ks", 5e7}, {"mu", 0}});
  r.shear_field = shear_forces(scene, path);
  r.field = press_forces(scene, path);
  const Calibration found = calibrate(request, r);
  EXPECT_NEAR(found.found.at("modulus"), 2e5, 1);
  EXPECT_EQ(found.found.at("mu"), 0);
  EXPECT_EQ(found.least_friction, 0);
  ASSERT_FALSE(found.untold.empty());
  EXPECT_EQ(found.untold.back().name, "mu");
  EXPECT_NE(found.untold.back().reason.find("it is about 0"), std::string::npos);
}

/// Pressures alone hold no friction, so it is not said what it would add.
TEST(FieldFit, PressuresAloneHaveNoFriction) {
  CalibrationRequest request = field_request(false);
  PressRecording r;
  for (int k = 1; k <= 5; ++k) r.depth.push_back(6e-5 * k);
  r.points = kFieldPoints;
  const auto scene = request.scene;
  request.scene = [=](const SkinNumbers& numbers) {
    SkinNumbers sticky = numbers;
    sticky["ks"] = 5e7, sticky["mu"] = 0.5;
    return scene(sticky);
  };
  r.field =
      press_forces(request.scene({{"modulus", 2e5}}),
                   {.depth = r.depth, .rate = {}, .time = {}, .x = {}, .y = {}, .fields = true});
  EXPECT_EQ(calibrate(request, r).friction.mu, 0);
  r.shear_field.assign(2 * r.field.size(), 0);
  EXPECT_EQ(calibrate(request, r).friction.mu, 0.5);
}

TEST(FieldFit, ColumnsOfOtherLengthsAreRefused) {
  const CalibrationRequest request = field_request(false);
  const PressRecording good = placed_presses(request.scene(kFieldTruth));
  PressRecording r = good;
  r.field.pop_back();
  EXPECT_THROW(calibrate(request, r), InputError);
  r = good, r.x.pop_back();
  EXPECT_THROW(calibrate(request, r), InputError);
  r = good, r.shear = r.x;
  EXPECT_THROW(calibrate(request, r), InputError) << "places beside a path";
  CalibrationRequest cell = request;
  cell.numbers = {"modulus", "force_zero"};
  EXPECT_THROW(calibrate(cell, good), InputError) << "a field has no load cell";
}

}  // namespace
}  // namespace tangere
