// SPDX-License-Identifier: Apache-2.0
// Tests readings of a sensor whose points a layer couples (docs/layer.md).
#include "engine/sense/layered_field.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using Numbers = std::vector<double>;

/// A ball of radius 7.5 mm above a gel like that of a GelSight Mini: E = 0.428 MPa, 4 mm thick.
Scene gel(double mu = 0, double ks = 0) {
  Scene s;
  s.links = {
      testing::link("plate", JointType::fixed, {0, 0, -0.005},
                    CuboidShape{{0.03, 0.03, 0.01}, {2, 2, 2}}, 1000),
      testing::link("ball", JointType::translational, {0, 0, 7.5e-3}, SphereShape{7.5e-3}, 1000)};
  TactileDescription t;
  t.name = "gel";
  t.body = "plate";
  t.array = {{-0.0093, 0.00708, 0.005}, {0.0093, -0.00708, 0.005}, {0, -1, 0}, {1, 0, 0}, 36, 47};
  t.material = SkinMaterial{0.428e6, 4e-3, 0};
  t.layer = LayerDescription{0.475, 0, 1.5e-3, {}};
  t.coefficients = {40, ks > 0 || mu > 0 ? 10.0 : 0, mu, 0, ks};
  s.sensors.push_back(t);
  s.gravity = {0, 0, 0};
  s.timestep = 1e-3;
  return s;
}

Numbers field_of(const Scene& scene, const Numbers& q, const Numbers& v) {
  const Model model(scene);
  Batch batch(model, 1, 0);
  batch.set_state(0, q, v);
  Numbers field(std::size_t(3 * model.sensors()[0].points));
  Readout(model).tactile(batch, 0, 0, field);
  return field;
}

double total(const Numbers& field, std::size_t component) {
  double sum = 0;
  for (std::size_t i = component; i < field.size(); i += 3) sum += field[i];
  return sum;
}

/// Forces that were measured on such a sensor (Helmut et al., FEATS), and what the same gel, from
/// E, ν and t alone, carries here.
TEST(LayeredField, CarriesTheMeasuredForces) {
  constexpr double kMeasured[][2] = {
      {0.5e-3, 1.6503}, {1e-3, 5.9641}, {1.5e-3, 13.5257}, {2e-3, 23.2532}};
  for (const auto& [depth, force] : kMeasured)
    EXPECT_NEAR(total(field_of(gel(), {0, 0, -depth}, {0, 0, 0}), 2) / force, 1, 0.13) << depth;
}

/// Springs do not matter: they find what touches.
TEST(LayeredField, DoesNotDependOnTheStiffnessOfItsSprings) {
  Scene soft = gel(), stiff = gel();
  stiff.sensors[0].coefficients.kn = 4000;
  const Numbers a = field_of(soft, {1e-3, 0, -1e-3}, {0, 0, 0}),
                b = field_of(stiff, {1e-3, 0, -1e-3}, {0, 0, 0});
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-12);
}

/// A slide: the friction of every point is μ times its own pressing force. Under a ball the
/// springs' friction lies in a plane that is a little off that of the surface below.
TEST(LayeredField, FrictionKeepsItsCone) {
  const Numbers field = field_of(gel(0.5), {0, 0, -1e-3}, {0.3, 0, 0}),
                none = field_of(gel(), {0, 0, -1e-3}, {0.3, 0, 0});
  int sliding = 0;
  for (std::size_t i = 0; i < field.size(); i += 3) {
    if (!(field[i + 2] > 0)) continue;
    ++sliding;
    const double shear =
        std::hypot(field[i] - none[i], field[i + 1] - none[i + 1], field[i + 2] - none[i + 2]);
    EXPECT_LE(shear / none[i + 2], 0.5 + 1e-12);
    EXPECT_GT(shear / none[i + 2], 0.49);
  }
  EXPECT_GT(sliding, 200);
}

Scene gel_under_a_box(double mu, double ks) {
  Scene s = gel(mu, ks);
  s.links[1] = testing::link("ball", JointType::translational, {0, 0, 0.005},
                             CuboidShape{{0.008, 0.008, 0.01}, {2, 2, 2}}, 1000);
  return s;
}

/// At an edge the springs' friction may lie along the pad's normal, where the layer's has no part.
TEST(LayeredField, FrictionOfAFlatPressAddsNoLoad) {
  const Numbers v = {0.05, 0, -0.1}, q = {0, 0, -2.5e-4};
  const double smooth = total(field_of(gel_under_a_box(0, 0), q, v), 2);
  EXPECT_NEAR(total(field_of(gel_under_a_box(1, 0), q, v), 2) / smooth, 1, 1e-6);
}

/// Where a body goes on below the layer, the layer is pressed to its back, and no more.
TEST(LayeredField, DepthEndsAtTheBack) {
  Scene s = gel();
  s.links[1] = testing::link("ball", JointType::translational, {-0.0275, 0, 0},
                             CuboidShape{{0.05, 0.05, 0.05}, {2, 2, 2}}, 1000);
  const Numbers field = field_of(s, {0, 0, 0}, {0, 0, 0});
  double most = 0;
  for (std::size_t i = 2; i < field.size(); i += 3) most = std::max(most, field[i]);
  EXPECT_GT(most, 0);
  // At an edge the pressure is a few times that of the whole layer pressed by t.
  const double confined = 0.428e6 * (1 - 0.475) / ((1 + 0.475) * (1 - 2 * 0.475));
  EXPECT_LT(most, 2 * confined * 0.4e-3 * 0.4e-3);
}

/// The springs let go of a body that leaves fast; a layer without relaxation does not.
TEST(LayeredField, AFastRetreatIsThatOfTheDepth) {
  Scene s = gel(0.5);
  s.sensors[0].coefficients.damping = 4e4;
  const Numbers still = field_of(s, {0, 0, -1e-3}, {0, 0, 0}),
                fast = field_of(s, {0, 0, -1e-3}, {0, 0, 1});
  EXPECT_NEAR(total(fast, 2), total(still, 2), 1e-9);
}

/// A gel that relaxes resists a fast press as if it were pressed deeper.
TEST(LayeredField, RelaxationAddsDepth) {
  Scene slow = gel();
  slow.sensors[0].material->relaxation = 0.01;
  const Numbers moving = field_of(slow, {0, 0, -1e-3}, {0, 0, -0.02});
  const double deeper = total(field_of(gel(), {0, 0, -1.2e-3}, {0, 0, 0}), 2),
               still = total(field_of(gel(), {0, 0, -1e-3}, {0, 0, 0}), 2);
  EXPECT_NEAR(total(moving, 2) / deeper, 1, 0.05);
  EXPECT_GT(total(moving, 2), 1.2 * still);
}

/// A flat body is carried by its edges.
TEST(LayeredField, EdgesOfFlatBodiesCarryMore) {
  const Numbers field = field_of(gel_under_a_box(0, 0), {0, 0, -2.5e-4}, {0, 0, 0});
  const auto at = [&](int row, int col) { return field[std::size_t(3 * (47 * row + col) + 2)]; };
  const double middle = at(18, 23);
  double edge = 0;
  for (int col = 23; col < 36; ++col) edge = std::max(edge, at(18, col));
  EXPECT_GT(middle, 0);
  EXPECT_GT(edge, 1.5 * middle);
  EXPECT_EQ(at(18, 40), 0);
}

/// Every way of reading gives the same bits, whatever is beside it.
TEST(LayeredField, FormsFramesAndNeighboursGiveTheSameBits) {
  for (const double ks : {0.0, 15.0}) {
    const Model model(gel(0.5, ks));
    const int points = model.sensors()[0].points;
    Batch batch(model, 19, 0);
    for (int e = 0; e < 19; ++e)
      batch.set_state(e, Numbers{1e-4 * e, 0, -1e-4 * e}, Numbers{0.01, 0.002 * e, 0});
    Stepper stepper(model);
    stepper.step(batch, {});
    Readout readout(model);
    const auto numbers = [&](FieldForm form) { return numbers_of(points, form); };
    std::vector<Numbers> block(16, Numbers(numbers(FieldForm::field)));
    std::vector<std::span<double>> spans(block.begin(), block.end());
    readout.read_block(batch, 0, FieldOutput{0, FieldForm::field}, spans);
    for (const int e : {3, 9}) {
      Numbers one(block[0].size()), shear(numbers(FieldForm::shear)), sum(numbers(FieldForm::sum)),
          pressure(numbers(FieldForm::pressure));
      readout.tactile(batch, e, 0, one);
      EXPECT_EQ(one, block[std::size_t(e)]);
      CompactFrame<double> compact(model, 0);
      readout.read(batch, e, compact);
      Numbers expanded(one.size());
      compact.expand(expanded);
      EXPECT_EQ(expanded, one);
      const auto read = [&](FieldForm form, Numbers& to) {
        std::vector<Numbers> all(16, Numbers(to.size()));
        std::vector<std::span<double>> into(all.begin(), all.end());
        readout.read_block(batch, 0, FieldOutput{0, form}, into);
        to = all[std::size_t(e)];
      };
      read(FieldForm::shear, shear), read(FieldForm::sum, sum), read(FieldForm::pressure, pressure);
      double z = 0;
      for (std::size_t p = 0; p < std::size_t(points); ++p) {
        EXPECT_EQ(shear[2 * p], one[3 * p]);
        EXPECT_EQ(shear[2 * p + 1], one[3 * p + 1]);
        z += one[3 * p + 2];
      }
      EXPECT_NEAR(std::abs(sum[2]), std::abs(z), 1e-12 * std::abs(z));
      double pressed = 0;
      for (const double p : pressure) pressed += p;
      EXPECT_GT(pressed, 0);
    }
  }
}

TEST(LayeredField, SensorsThatCannotHaveALayerAreRefused) {
  const auto fault = [](const auto& change) -> std::string {
    Scene s = gel();
    change(s.sensors[0]);
    try {
      static_cast<void>(Model(s));
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(fault([](TactileDescription&) {}), "");
  EXPECT_THAT(fault([](TactileDescription& d) { d.material.reset(); }),
              HasSubstr("no material; expected modulus and thickness"));
  EXPECT_THAT(fault([](TactileDescription& d) {
                d.points = {{{0, 0, 0.005}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
                            {{0, 1e-3, 0.004}, {0, 0.6, 0.8}, {1, 0, 0}, {0, 0.8, -0.6}}};
              }),
              HasSubstr("points in a list; expected a flat array"))
      << "a layer on a curved skin has not been verified";
  EXPECT_THAT(fault([](TactileDescription& d) { d.material->thickness = 1e-3; }),
              HasSubstr("expected at most a third of the thickness"));
  EXPECT_THAT(fault([](TactileDescription& d) { d.imperfections.delay = 0.01; }),
              HasSubstr("delay, low_pass or hysteresis"));
  EXPECT_THAT(fault([](TactileDescription& d) { d.layer->poisson = 0.5; }), HasSubstr("poisson"));
  EXPECT_THAT(fault([](TactileDescription& d) { d.material->thickness = 4; }),
              HasSubstr("times the pad's longer side"));
  EXPECT_THAT(fault([](TactileDescription& d) { d.layer->cell = 1e-4; }),
              HasSubstr("at least the distance of the points"));
  EXPECT_THAT(fault([](TactileDescription& d) { d.layer->cell = 1; }),
              HasSubstr("at most the pad's shorter side"));
  EXPECT_THAT(fault([](TactileDescription& d) {
                d.array.rows = d.array.cols = 100;
                d.layer->cell = 1.5e-4;
              }),
              HasSubstr("expected at most 4096 of them"));
}

}  // namespace
}  // namespace tangere
