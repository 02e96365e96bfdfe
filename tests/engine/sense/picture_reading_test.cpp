// SPDX-License-Identifier: Apache-2.0
// Tests pictures of sensors: what they show of springs and of layers, their axes, their types, and
// that environments do not matter to each other.
#include "engine/sense/picture_reading.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "engine/sense/form_map.hpp"
#include "engine/sense/readout.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using Numbers = std::vector<double>;
constexpr int kRowsOfPad = 14, kColsOfPad = 12, kPictureRows = 28, kPictureCols = 24;
constexpr double kPressDepth = 0.8e-3;  // [m]

/// A ball that presses a gel off its middle, at 1.5 mm along axis0 and -1 mm along axis1.
Scene pictured_gel() {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {testing::link("plate", JointType::fixed, {0, 0, -0.005},
                           CuboidShape{{0.02, 0.02, 0.01}, {2, 2, 2}}, 1000),
             testing::link("ball", JointType::translational, {1.5e-3, -1e-3, 3e-3},
                           SphereShape{3e-3}, 1000)};
  TactileDescription t;
  t.name = "gel";
  t.body = "plate";
  t.source = {"gel.xml", 9};
  t.array = {{-0.0065, -0.0055, 0.005},
             {0.0065, 0.0055, 0.005},
             {1, 0, 0},
             {0, 1, 0},
             kRowsOfPad,
             kColsOfPad};
  t.material = SkinMaterial{0.4e6, 4e-3, 0};
  t.coefficients = {40, 20, 0.8, 0, 16};
  t.markers.emplace();
  t.picture.emplace();
  t.picture->rows = kPictureRows, t.picture->cols = kPictureCols;
  t.picture->gel = std::make_shared<const Gel>(default_gel());
  t.picture->source = {"gel.xml", 11};
  t.picture->markers = {3, 4};
  s.sensors.push_back(t);
  return s;
}

void set_pressed(Batch& batch, int environment, double depth = kPressDepth) {
  batch.set_state(environment, Numbers{0, 0, -depth}, Numbers{0, 0, 0});
}

template <class T>
std::vector<T> picture(const Scene& scene, FieldForm form, double depth = kPressDepth) {
  const Model model(scene);
  Batch batch(model, 1, 3);
  set_pressed(batch, 0, depth);
  std::vector<T> out(numbers_of(model.sensors()[0], form));
  const std::span<T> to(out);
  Readout(model).read_block(batch, 0, {0, form}, std::span<const std::span<T>>(&to, 1));
  return out;
}

std::string refusal(const Scene& scene, FieldForm form) {
  try {
    static_cast<void>(picture<double>(scene, form));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(PictureReading, IsTheBackgroundWithoutTouch) {
  const Scene scene = pictured_gel();
  const auto bytes = picture<std::uint8_t>(scene, FieldForm::rgb, -1e-3);
  for (const std::uint8_t level : bytes) ASSERT_EQ(level, 100);
  EXPECT_EQ(picture<float>(scene, FieldForm::height, -1e-3),
            std::vector<float>(kPictureRows * kPictureCols, 0.0F));
}

/// The place of the largest number, in points.
std::array<double, 2> highest(const Numbers& heights) {
  const auto at = std::max_element(heights.begin(), heights.end()) - heights.begin();
  return {(double(at / kPictureCols) + 0.5) * kRowsOfPad / kPictureRows - 0.5,
          (double(at % kPictureCols) + 0.5) * kColsOfPad / kPictureCols - 0.5};
}

TEST(PictureReading, ShowsTheBallWhereItPressesAndAsDeep) {
  const Scene plain = pictured_gel();
  const Numbers heights = picture<double>(plain, FieldForm::height);
  EXPECT_NEAR(*std::max_element(heights.begin(), heights.end()), kPressDepth, 0.2 * kPressDepth);
  const double row = 8, col = 4.5;  // of the ball: 1 mm between points
  EXPECT_NEAR(highest(heights)[0], row, 0.6);
  EXPECT_NEAR(highest(heights)[1], col, 0.6);
  Scene other = plain;
  std::swap(other.sensors[0].array.corner0[0], other.sensors[0].array.corner1[0]);
  EXPECT_NEAR(highest(picture<double>(other, FieldForm::height))[0], kRowsOfPad - 1 - row, 0.6);
  other = plain;
  other.sensors[0].picture->mirror = true;
  EXPECT_NEAR(highest(picture<double>(other, FieldForm::height))[1], kColsOfPad - 1 - col, 0.6);
}

TEST(PictureReading, EndsAtTheThicknessOfATable) {
  for (const double thickness : {0.0, 0.5e-3}) {
    Scene scene = pictured_gel();
    TactileDescription& gel = scene.sensors[0];
    gel.material.reset();
    gel.table = PressureTable{{0, 0.1e-3, 0.2e-3}, {0, 1e3, 2e3}, thickness, 0};
    gel.coefficients = {gel.table->stiffness() * 1e-6, 0, 0, 0, 0};
    gel.markers.reset();
    gel.picture->markers = {};
    const double deepest = thickness > 0 ? thickness : 0.4e-3;
    const Numbers heights = picture<double>(scene, FieldForm::height);
    const double highest_of_all = *std::max_element(heights.begin(), heights.end());
    EXPECT_LE(highest_of_all, deepest * (1 + 1e-6));
    EXPECT_GT(highest_of_all, 0.8 * deepest);
  }
}

TEST(PictureReading, HasNoHeightsWhereNoPlaceIsKnown) {
  const Scene scene = pictured_gel();
  for (const double h : picture<double>(scene, FieldForm::height, NAN))
    ASSERT_TRUE(std::isnan(h)) << h;
  for (const std::uint8_t level : picture<std::uint8_t>(scene, FieldForm::rgb, NAN))
    ASSERT_EQ(level, 0);
}

TEST(PictureReading, OfALayerShowsItsSurface) {
  Scene scene = pictured_gel();
  scene.sensors[0].layer = LayerDescription{0.475, 1e-3, 1e-3, {}};
  const Numbers surface = picture<double>(scene, FieldForm::surface),
                heights = picture<double>(scene, FieldForm::height);
  double deepest = 0, sum = 0, volume = 0;
  for (std::size_t k = 2; k < surface.size(); k += 3)
    deepest = std::max(deepest, -surface[k]), sum -= surface[k];
  for (const double h : heights) volume += h;
  EXPECT_NEAR(*std::max_element(heights.begin(), heights.end()), deepest, 0.25 * deepest);
  EXPECT_NEAR(volume / double(heights.size()) * (double(surface.size()) / 3), sum,
              0.05 * std::abs(sum));
}

TEST(PictureReading, HasBytesThatAreItsNumbersRounded) {
  for (const bool layered : {false, true})
    for (const FieldForm form : {FieldForm::rgb, FieldForm::rgb_marker}) {
      Scene scene = pictured_gel();
      if (layered) scene.sensors[0].layer = LayerDescription{0.475, 1e-3, 1e-3, {}};
      scene.sensors[0].picture->noise = 2;
      const auto bytes = picture<std::uint8_t>(scene, form);
      const auto numbers = picture<float>(scene, form);
      int changed = 0;
      for (std::size_t k = 0; k < bytes.size(); ++k) {
        ASSERT_NEAR(bytes[k], numbers[k], 0.5001) << k;
        changed += std::abs(numbers[k] - 100) > 10;
      }
      EXPECT_GT(changed, 50) << to_string(form);
    }
}

/// Centre of what is darker in one picture than in another, in a part of it.
std::array<double, 2> dark_centre(const std::vector<std::uint8_t>& dark,
                                  const std::vector<std::uint8_t>& bright, int row, int col) {
  double sum = 0, down = 0, across = 0;
  for (int i = row; i < row + 7; ++i)
    for (int j = col; j < col + 8; ++j) {
      const auto k = std::size_t(3 * (i * kPictureCols + j));
      const double d = bright[k] - dark[k];
      sum += d, down += d * (i + 0.5), across += d * (j + 0.5);
    }
  return {down / sum, across / sum};
}

TEST(PictureReading, MovesItsMarkersAlongTheAxesOfTheField) {
  for (const bool mirror : {false, true}) {
    Scene scene = pictured_gel();
    TactileDescription& gel = scene.sensors[0];
    gel.coefficients.ks = 0;  // shear by sliding
    gel.markers->stiffness = 200;
    gel.picture->mirror = mirror;
    gel.picture->marker_radius = 1e-3;
    gel.picture->gel = std::make_shared<const Gel>([] {
      Gel flat;
      flat.background = {1, 1, {200, 200, 200}};
      return flat;
    }());
    const Model model(scene);
    const auto read = [&](const Numbers& v, FieldForm form) {
      Batch batch(model, 1, 0);
      batch.set_state(0, Numbers{0, 0, -kPressDepth}, v);
      std::vector<std::uint8_t> out(numbers_of(model.sensors()[0], form));
      const std::span<std::uint8_t> to(out);
      Readout(model).read_block(batch, 0, {0, form},
                                std::span<const std::span<std::uint8_t>>(&to, 1));
      return out;
    };
    // The marker of row 2, column 1 (or, mirrored, of the same column) is below the ball.
    const auto plain = read({0, 0, 0}, FieldForm::rgb);
    const auto rest = dark_centre(read({0, 0, 0}, FieldForm::rgb_marker), plain, 14, 8),
               moved = dark_centre(read({0.02, 0.01, 0}, FieldForm::rgb_marker), plain, 14, 8);
    EXPECT_GT(moved[0], rest[0] + 0.01);
    EXPECT_GT((mirror ? -1 : 1) * (moved[1] - rest[1]), 0.005);
  }
}

TEST(PictureReading, DoesNotDependOnOtherEnvironments) {
  Scene scene = pictured_gel();
  scene.sensors[0].picture->noise = 1;
  const Model model(scene);
  constexpr int kMany = 19;
  Batch many(model, kMany, 5);
  std::vector<std::vector<std::uint8_t>> all(kMany);
  std::vector<std::span<std::uint8_t>> to;
  for (int e = 0; e < kMany; ++e) {
    set_pressed(many, e, 1e-4 * e);
    all[std::size_t(e)].resize(numbers_of(model.sensors()[0], FieldForm::rgb));
    to.emplace_back(all[std::size_t(e)]);
  }
  Readout readout(model, Precision::mixed);
  for (int block = 0; block < many.blocks(); ++block)
    readout.read_block(
        many, block, {0, FieldForm::rgb},
        std::span<const std::span<std::uint8_t>>(to).subspan(std::size_t(16 * block)));
  for (const int e : {0, 3, 17}) {
    Batch alone(model, 1, 5, e);
    set_pressed(alone, 0, 1e-4 * e);
    std::vector<std::uint8_t> one(all[0].size());
    const std::span<std::uint8_t> there(one);
    Readout(model).read_block(alone, 0, {0, FieldForm::rgb},
                              std::span<const std::span<std::uint8_t>>(&there, 1));
    EXPECT_EQ(one, all[std::size_t(e)]) << e;
  }
  EXPECT_NE(all[3], all[17]);
}

TEST(PictureReading, OfALayerFollowsFromTheFieldWithItsPullback) {
  Scene scene = pictured_gel();
  scene.sensors[0].layer = LayerDescription{0.475, 1e-3, 1e-3, {}};
  const Model model(scene);
  const Numbers field = picture<double>(scene, FieldForm::ideal);
  testing::Random random(3);
  for (const FieldForm form : {FieldForm::height, FieldForm::rgb}) {
    const FormMap map(model, {0, form});
    Numbers form_numbers(map.size()), weights(map.size()), bar(field.size());
    map.evaluate(field, form_numbers);
    const Numbers read = picture<double>(scene, form);
    for (std::size_t k = 0; k < read.size(); ++k)
      ASSERT_NEAR(form_numbers[k], read[k], form == FieldForm::rgb ? 0.01 : 1e-9) << k;
    for (double& w : weights) w = random.uniform(-1, 1);
    map.pull_back(field, weights, bar);
    Numbers change(field.size());
    for (std::size_t k = 0; k < field.size(); ++k) change[k] = field[k] * random.uniform(-1, 1);
    const auto loss = [&](double step) {
      Numbers at = field, out(map.size());
      for (std::size_t k = 0; k < at.size(); ++k) at[k] += step * change[k];
      map.evaluate(at, out);
      double sum = 0;
      for (std::size_t k = 0; k < out.size(); ++k) sum += weights[k] * out[k];
      return sum;
    };
    double along = 0;
    for (std::size_t k = 0; k < field.size(); ++k) along += bar[k] * change[k];
    const double differences = (loss(1e-4) - loss(-1e-4)) / 2e-4;
    EXPECT_NEAR(along, differences, 1e-5 * std::abs(differences)) << to_string(form);
  }
}

TEST(PictureReading, RefusesWhatASensorLacks) {
  Scene scene = pictured_gel();
  EXPECT_THROW(picture<std::uint8_t>(scene, FieldForm::height), InputError);
  scene.sensors[0].picture->markers = {};
  EXPECT_THAT(refusal(scene, FieldForm::rgb_marker),
              HasSubstr("gel.xml:9: sensor 'gel' has no <picture> with markers"));
  scene.sensors[0].picture.reset();
  EXPECT_THAT(refusal(scene, FieldForm::rgb), HasSubstr("has no <picture>"));
  scene = pictured_gel();
  scene.sensors[0].markers.reset();
  EXPECT_THAT(refusal(scene, FieldForm::rgb),
              HasSubstr("gel.xml:11: picture of 'gel': markers without <markers>"));
  scene = pictured_gel();
  scene.sensors[0].array.rows = 1;
  EXPECT_THAT(refusal(scene, FieldForm::rgb), HasSubstr("expected at least 2 x 2"));
}

}  // namespace
}  // namespace tangere
