// SPDX-License-Identifier: Apache-2.0
// Tests how a layer's surface and its markers move: axes, signs, forms and pullbacks.
#include "engine/sense/surface_map.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "engine/scene/scene_number.hpp"
#include "engine/sense/form_map.hpp"
#include "engine/sense/readout.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using Numbers = std::vector<double>;
constexpr int kMapRows = 12, kMapCols = 10;

/// How the points of a gel are counted: along its axes, rows or columns against them, or with axis1
/// turned round, so that axis0 × axis1 points into the gel.
enum class Count { along, rows_against, cols_against, turned };

/// A ball that presses and slides on a gel, off its middle.
Scene pressed_gel(Count count = Count::along) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {testing::link("plate", JointType::fixed, {0, 0, -0.005},
                           CuboidShape{{0.02, 0.02, 0.01}, {2, 2, 2}}, 1000),
             testing::link("ball", JointType::translational, {1e-3, -7e-4, 5e-3}, SphereShape{5e-3},
                           1000)};
  TactileDescription t;
  t.name = "gel";
  t.body = "plate";
  t.source = {"gel.xml", 9};
  t.array = {
      {-0.0055, -0.0045, 0.005}, {0.0055, 0.0045, 0.005}, {1, 0, 0}, {0, 1, 0}, kMapRows, kMapCols};
  const std::size_t swapped = count == Count::rows_against ? 0 : 1;
  if (count != Count::along) std::swap(t.array.corner0[swapped], t.array.corner1[swapped]);
  if (count == Count::turned) t.array.axis1 = {0, -1, 0};
  t.material = SkinMaterial{0.4e6, 4e-3, 0};
  t.layer = LayerDescription{0.475, 1e-3, 1e-3, {}};
  t.coefficients = {40, 20, 0.8, 0};
  t.markers.emplace();
  t.markers->source = {"gel.xml", 10};
  s.sensors.push_back(t);
  return s;
}

Numbers read(const Model& model, FieldForm form) {
  Batch batch(model, 1, 0);
  batch.set_state(0, Numbers{0, 0, -0.6e-3}, Numbers{0.01, 0.02, 0});
  Numbers out(numbers_of(model.sensors()[0].points, form));
  const std::span<double> to(out);
  Readout(model).read_block(batch, 0, {0, form}, {&to, 1});
  return out;
}

/// The ball presses the surface down beneath it. Beside it the gel bulges, and it goes along with
/// the friction.
TEST(SurfaceMap, GoesDownBeneathABodyAndUpBesideIt) {
  const Model model(pressed_gel());
  const Numbers u = read(model, FieldForm::surface), f = read(model, FieldForm::field);
  const auto at = [&](const Numbers& x, int row, int col, int axis) {
    return x[std::size_t(3 * (kMapCols * row + col) + axis)];
  };
  EXPECT_NEAR(at(u, 6, 4, 2), -0.55e-3, 0.1e-3);  // the middle of the contact is at (6.5, 3.8)
  EXPECT_GT(at(u, 0, 4, 2), 0);
  EXPECT_GT(at(f, 6, 4, 0), 0);  // friction along the motion
  EXPECT_GT(at(u, 6, 4, 0), 0);
  EXPECT_GT(at(u, 6, 4, 1), at(u, 6, 4, 0));
}

TEST(SurfaceMap, DoesNotDependOnTheWayPointsAreCounted) {
  const Numbers u = read(Model(pressed_gel()), FieldForm::surface);
  for (const Count count : {Count::rows_against, Count::cols_against, Count::turned}) {
    const Model model(pressed_gel(count));
    EXPECT_EQ(model.sensors()[0].pressure_sign, count == Count::turned ? -1 : 1);
    const Numbers v = read(model, FieldForm::surface);
    for (int i = 0; i < kMapRows; ++i)
      for (int j = 0; j < kMapCols; ++j)
        for (int axis = 0; axis < 3; ++axis) {
          const int row = count == Count::rows_against ? kMapRows - 1 - i : i,
                    col = count == Count::rows_against ? j : kMapCols - 1 - j;
          const double sign = count == Count::turned && axis == 1 ? -1 : 1;
          EXPECT_NEAR(u[std::size_t(3 * (kMapCols * i + j) + axis)],
                      sign * v[std::size_t(3 * (kMapCols * row + col) + axis)], 1e-12);
        }
  }
}

TEST(SurfaceMap, MarkersMoveAlong) {
  const Model model(pressed_gel());
  const Numbers u = read(model, FieldForm::surface), m = read(model, FieldForm::markers);
  for (std::size_t k = 0; k < m.size(); ++k) EXPECT_EQ(m[k], u[k / 2 * 3 + k % 2]);
}

TEST(SurfaceMap, IsAFormOfTheField) {
  const Model model(pressed_gel());
  const Numbers field = read(model, FieldForm::field);
  testing::Random random(5);
  for (const FieldForm form : {FieldForm::surface, FieldForm::markers}) {
    const FormMap map(model, {0, form});
    Numbers u(map.size()), bar(map.size()), back(map.field_size());
    map.evaluate(field, u);
    EXPECT_EQ(u, read(model, form));
    for (double& x : bar) x = random.uniform(-1, 1);
    map.pull_back(field, bar, back);
    double one = 0, two = 0;
    for (std::size_t k = 0; k < u.size(); ++k) one += bar[k] * u[k];
    for (std::size_t k = 0; k < field.size(); ++k) two += back[k] * field[k];
    EXPECT_NEAR(one, two, 1e-12 * std::abs(one)) << to_string(form);
  }
}

TEST(SurfaceMap, WhatCannotBeIsRefusedWithItsLine) {
  const auto refused = [](const Scene& scene, const std::string& text) {
    try {
      const Model model(scene);
      Batch batch(model, 1, 0);
      Numbers u(std::size_t(3 * kMapRows * kMapCols));
      const std::span<double> to(u);
      Readout(model).read_block(batch, 0, {0, FieldForm::surface}, {&to, 1});
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(text));
    }
  };
  Scene s = pressed_gel();
  s.sensors[0].markers->stiffness = 20;
  refused(s, "gel.xml:10: markers of 'gel': stiffness, thickness or spread beside <layer>");
  s = pressed_gel();
  s.sensors[0].markers.reset();
  refused(s, "gel.xml:9: sensor 'gel' has no <markers>");
  s = pressed_gel();
  s.sensors[0].layer.reset();
  s.sensors[0].markers->stiffness = 20;
  refused(s, "gel.xml:9: sensor 'gel' has no <layer>");
  s = pressed_gel();
  SceneNumber kn = first_number(s.sensors[0]);
  kn.field = NumberField::kn;
  RandomizationDescription drawn;
  drawn.number = kn;
  drawn.distribution = {Distribution::Kind::uniform, 30, 50, {}};
  s.randomizations.push_back(drawn);
  refused(s, "gel.xml:10: markers of 'gel': its kn varies");
  s = pressed_gel();
  s.sensors[0].material->thickness = 0.04;
  s.sensors[0].layer->source = {"gel.xml", 11};
  s.sensors[0].layer->cell = 1e-3;
  refused(s, "gel.xml:11: <layer> of 'gel': free sides 0.012 m apart; expected at least half");
}

}  // namespace
}  // namespace tangere
