// SPDX-License-Identifier: Apache-2.0
// Tests derivatives of readings of a coupled layer and of a table of pressures: in dual numbers, in
// reverse and by differences.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "engine/derivative/field_tangent.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/scene/sensor_contacts.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/tape.hpp"
#include "tests/engine/field_loss.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using testing::kBlock;
using testing::Pad;
using testing::PadState;
using testing::Random;
using Numbers = std::vector<double>;

constexpr int kLayerLane = 5;

Scene layer_scene(PrimitiveShape shape, Pad pad) {
  Scene s = testing::pad_scene(shape, ContactLaw::clamped, pad);
  s.sensors[0].material = SkinMaterial{1e5, 0.02, 0.01};
  s.sensors[0].layer = LayerDescription{0.45, 0.01, 0.002, {}};
  s.sensors[0].feels = {"thing"};
  return s;
}

/// The same layer by the law that it has where it is the contact.
Scene contact_scene(PrimitiveShape shape, Pad pad) {
  Scene s = layer_scene(shape, pad);
  s.sensors[0].layer->feedback = true;
  add_sensor_contacts(s, s.sensors[0]);
  return s;
}

/// The same pad with pressures by depth.
Scene table_scene(PrimitiveShape shape, Pad pad) {
  Scene s = testing::pad_scene(shape, ContactLaw::clamped, pad);
  s.sensors[0].table = PressureTable{{0, 0.003, 0.008, 0.015}, {0, 1e4, 2e4, 2e5}, 0.02, 0.01};
  s.sensors[0].feels = {"thing"};
  return s;
}

struct LayerRead {
  Batch batch;
  BlockTape tape;

  LayerRead(const Model& model, const PadState& s)
      : batch(model, kBlock, 9), tape(model, Integrator::bdf1, 1) {
    batch.set_state(kLayerLane, s.q, s.v);
    tape.start(batch, 0);
  }
  [[nodiscard]] Numbers field() const {
    Numbers all(std::size_t(3 * batch.model().sensors()[0].points));
    Readout(batch.model()).tactile(batch, kLayerLane, 0, all);
    return all;
  }
};

Numbers layer_numbers(Random& random, std::size_t n, double size) {
  Numbers x(n);
  for (double& a : x) a = size * random.normal();
  return x;
}

using SceneOf = Scene (*)(PrimitiveShape, Pad);
class LayerGradient : public ::testing::TestWithParam<std::tuple<SceneOf, PrimitiveShape, Pad>> {};

/// By the state, by kn (of which E is a multiple), by the size of the shape and by t and ν.
TEST_P(LayerGradient, DualNumbersReverseAndDifferencesAgree) {
  const auto [scene_of, shape, pad] = GetParam();
  const Scene scene = scene_of(shape, pad);
  const Model model(scene);
  const CompiledModel& m = compiled(model);
  Random random(11);
  const auto nv = std::size_t(model.nv());
  const auto rows = std::size_t(m.view.rows.count);
  const auto kn = std::size_t(m.view.rows.sensor(0)), size = std::size_t(m.view.rows.solid(2)),
             material = std::size_t(m.layer_row(0));
  const bool layered = scene.sensors[0].layer.has_value();
  int touching = 0, compared = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const PadState s = testing::random_pad_state(model, random);
    const Numbers dq = layer_numbers(random, nv, 0.01), dv = layer_numbers(random, nv, 1);
    Numbers dp(rows);
    dp[kn] = 20 * random.normal();
    for (std::size_t k = 0; k < 3; ++k) dp[size + k] = 1e-3 * random.normal();
    if (layered) dp[material] = 1e-3 * random.normal(), dp[material + 1] = 0.05 * random.normal();
    LayerRead at(model, s);
    const Numbers here = at.field();
    if (std::all_of(here.begin(), here.end(), [](double x) { return x == 0; })) continue;
    ++touching;
    Numbers duals(here.size());
    Tangent(model).field(at.batch, 0, kLayerLane, at.tape, 0, 0, dp, {}, {dq, dv, {}, {}}, duals);
    const double length =
        std::sqrt(std::inner_product(duals.begin(), duals.end(), duals.begin(), 0.0));

    const Numbers weights = layer_numbers(random, duals.size(), 1);
    ReadoutPullback pullback(model);
    BlockCotangent c;
    for (auto* x : {&c.q, &c.v}) x->assign(nv * kBlock, 0.0);
    c.parameters.assign(rows * kBlock, 0.0);
    pullback.place(at.batch, 0);
    pullback.clear();
    pullback.dense_field(kLayerLane, 0, weights, c.parameters);
    pullback.finish(c);
    double back = 0;
    for (std::size_t i = 0; i < nv; ++i)
      back += c.q[i * kBlock + kLayerLane] * dq[i] + c.v[i * kBlock + kLayerLane] * dv[i];
    for (std::size_t i = 0; i < rows; ++i) back += c.parameters[i * kBlock + kLayerLane] * dp[i];
    const double along = std::inner_product(weights.begin(), weights.end(), duals.begin(), 0.0);
    EXPECT_NEAR(along, back, 1e-10 * length * std::sqrt(double(weights.size())));

    // Differences by the state and by the material; a difference across a point that begins to
    // press is one-sided.
    Numbers by_state(here.size()), material_dot(rows);
    if (layered) std::copy_n(&dp[material], 2, &material_dot[material]);
    Tangent(model).field(at.batch, 0, kLayerLane, at.tape, 0, 0, material_dot, {}, {dq, dv, {}, {}},
                         by_state);
    const auto moved = [&](double e) {
      PadState t = s;
      for (std::size_t i = 0; i < nv; ++i) {
        t.q = testing::moved(model, t.q, int(i), e * dq[i]);
        t.v[i] += e * dv[i];
      }
      if (!layered) return LayerRead(model, t).field();
      Scene other = scene;
      other.sensors[0].material->thickness += e * dp[material];
      other.sensors[0].layer->poisson += e * dp[material + 1];
      return LayerRead(Model(other), t).field();
    };
    const double e = 1e-6;
    const Numbers up = moved(e), down = moved(-e);
    const auto pressing = [](const Numbers& f) {
      std::vector<bool> out;
      for (std::size_t i = 2; i < f.size(); i += 3) out.push_back(f[i] != 0);
      return out;
    };
    if (pressing(up) != pressing(here) || pressing(down) != pressing(here)) continue;
    ++compared;
    for (std::size_t i = 0; i < here.size(); ++i)
      EXPECT_NEAR((up[i] - down[i]) / (2 * e), by_state[i], 1e-5 * length + 1e-6) << i;
  }
  EXPECT_GE(touching, 4);
  EXPECT_GE(compared, 2);
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, LayerGradient,
    ::testing::Combine(::testing::Values(&layer_scene, &table_scene),
                       ::testing::Values(PrimitiveShape::sphere, PrimitiveShape::cuboid,
                                         PrimitiveShape::cylinder, PrimitiveShape::capsule,
                                         PrimitiveShape::ellipsoid, PrimitiveShape::mesh),
                       ::testing::Values(Pad::flat, Pad::skewed)));

INSTANTIATE_TEST_SUITE_P(
    Contacts, LayerGradient,
    ::testing::Combine(::testing::Values(&contact_scene),
                       ::testing::Values(PrimitiveShape::sphere, PrimitiveShape::cuboid,
                                         PrimitiveShape::cylinder, PrimitiveShape::capsule,
                                         PrimitiveShape::ellipsoid),
                       ::testing::Values(Pad::flat, Pad::skewed)));

/// p is proportional to E, so by kn the normal force has the derivative N/kn.
TEST(LayerGradient, NormalForcesAreProportionalToKn) {
  for (const SceneOf scene_of : {layer_scene, table_scene}) {
    const Model model(scene_of(PrimitiveShape::sphere, Pad::flat));
    const CompiledModel& m = compiled(model);
    Random random(11);
    double most = 0;
    for (int trial = 0; trial < 12; ++trial) {
      PadState s = testing::random_pad_state(model, random);
      std::fill(s.v.begin(), s.v.end(), 0.0);
      LayerRead at(model, s);
      Numbers dp(std::size_t(m.view.rows.count));
      dp[std::size_t(m.view.rows.sensor(0))] = 1;
      const Numbers here = at.field();
      Numbers duals(here.size());
      const Numbers none(std::size_t(model.nv()));
      Tangent(model).field(at.batch, 0, kLayerLane, at.tape, 0, 0, dp, {}, {none, none, {}, {}},
                           duals);
      for (std::size_t i = 2; i < here.size(); i += 3) {
        EXPECT_NEAR(duals[i], here[i] / 200, 1e-12 * std::abs(here[i]));
        most = std::max(most, std::abs(here[i]));
      }
    }
    EXPECT_GT(most, 1e-3);
  }
}

TEST(LayerGradient, WhatHasNoDerivativeIsRefused) {
  const Model model(layer_scene(PrimitiveShape::sphere, Pad::flat));
  Random random(11);
  const PadState s = testing::random_pad_state(model, random);
  const LayerRead at(model, s);
  ReadoutPullback pullback(model);
  pullback.place(at.batch, 0);
  pullback.clear();
  Numbers cotangent(at.field().size(), 1.0),
      points(std::size_t(model.sensors()[0].points * kPointNumbers));
  const auto fault = [](const auto& f) -> std::string {
    try {
      f();
      return "";
    } catch (const InputError& error) {
      return error.what();
    }
  };
  EXPECT_THAT(fault([&] { pullback.dense_field(kLayerLane, 0, cotangent, {}, points); }),
              ::testing::HasSubstr("'skin', which has a layer"));
  FieldTangent tangent(model);
  tangent.place(at.batch, 0);
  const Numbers none(std::size_t(model.nv()));
  tangent.move(kLayerLane, none, none);
  Numbers change(3 * 64);
  const std::vector<int> tiles = {0};
  EXPECT_THAT(fault([&] { tangent.field(0, tiles, change); }),
              ::testing::HasSubstr("'skin' has a layer"));
}

}  // namespace
}  // namespace tangere
