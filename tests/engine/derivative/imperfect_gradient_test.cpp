// SPDX-License-Identifier: Apache-2.0
// Tests derivatives of imperfect readings: forward, in dual numbers, in reverse and by differences
// with the same noise.
#include <gtest/gtest.h>

#include <numeric>

#include "engine/derivative/field_tangent.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/tape.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using testing::kBlock;
using testing::Pad;
using testing::PadState;
using testing::Random;
using Numbers = std::vector<double>;

constexpr int kLane = 5;

Scene scene_with(Pad pad, double quantisation) {
  Scene s = testing::pad_scene(PrimitiveShape::sphere, ContactLaw::clamped, pad);
  SensorImperfections& i = s.sensors[0].imperfections;
  if (pad != Pad::curved) i.crosstalk = 0.07, i.spread = 0.005;
  i.gain = 0.1, i.sensor_gain = 0.1, i.dead = 0.1;
  i.bias = {0.01, 0.01}, i.noise = {0.02, 0.01};
  i.saturation = {0.05, 0.02};
  i.quantisation = {quantisation, quantisation};
  return s;
}

struct Read {
  Batch batch;
  BlockTape tape;
  CompactFrame<double> frame;

  Read(const Model& model, const PadState& s)
      : batch(model, kBlock, 9), tape(model, Integrator::bdf1, 1), frame(model, 0) {
    batch.set_state(kLane, s.q, s.v);
    batch.set_steps(kLane, 12);
    tape.start(batch, 0);
    Readout(model).read(batch, kLane, frame);
  }
  [[nodiscard]] Numbers field() const {
    Numbers all(frame.dense_size());
    frame.expand(all);
    return all;
  }
};

Numbers random_numbers(Random& random, std::size_t n, double size) {
  Numbers x(n);
  for (double& a : x) a = size * random.normal();
  return x;
}

class ImperfectGradient : public ::testing::TestWithParam<Pad> {};

TEST_P(ImperfectGradient, ThreeRoutesAndDifferencesAgree) {
  const Model model(scene_with(GetParam(), 0)), rounded(scene_with(GetParam(), 0.001));
  Random random(11);
  const auto nv = std::size_t(model.nv());
  double seen = 0;
  int flat = 0;
  for (int trial = 0; trial < 6; ++trial) {
    const PadState s = testing::random_pad_state(model, random);
    const Numbers dq = random_numbers(random, nv, 0.01), dv = random_numbers(random, nv, 1);
    Read at(model, s);
    const StateTangent d{dq, dv, {}, {}};
    Numbers duals(at.frame.dense_size()), forward(duals.size());
    Tangent(model).field(at.batch, 0, kLane, at.tape, 0, 0, {}, {}, d, duals);
    const double size =
        std::sqrt(std::inner_product(duals.begin(), duals.end(), duals.begin(), 0.0));
    seen += size;

    FieldTangent tangent(model);
    tangent.place(at.batch, 0);
    tangent.move(kLane, dq, dv);
    Numbers of_tiles(at.frame.values().size());
    tangent.field(0, at.frame.tiles(), of_tiles);
    at.frame.spread(of_tiles, forward);
    for (std::size_t i = 0; i < duals.size(); ++i)
      ASSERT_NEAR(forward[i], duals[i], 1e-12 * size) << i;

    // The noise is that of the episode and the step, so differences do not see it.
    const auto moved = [&](double e) {
      PadState t = s;
      for (std::size_t i = 0; i < nv; ++i) {
        t.q = testing::moved(model, t.q, int(i), e * dq[i]);
        t.v[i] += e * dv[i];
      }
      return Read(model, t).field();
    };
    const double e = 1e-5;
    const Numbers up = moved(e), down = moved(-e), here = at.field();
    int off = 0;
    for (std::size_t i = 0; i < duals.size(); ++i) {
      off += std::abs((up[i] - down[i]) / (2 * e) - duals[i]) > 1e-4 * size ? 1 : 0;
      const double limit = i % 3 == 2 ? 0.05 : 0.02;
      if (here[i] != 0 && std::abs(here[i]) < limit) continue;
      ++flat;
      EXPECT_EQ(duals[i], 0) << i;
    }
    EXPECT_LE(off, 4);  // numbers that a difference takes across a kink

    const Numbers weights = random_numbers(random, duals.size(), 1);
    for (const bool dense : {true, false}) {
      ReadoutPullback pullback(model);
      BlockCotangent c;
      for (auto* x : {&c.q, &c.v}) x->assign(nv * kBlock, 0.0);
      pullback.place(at.batch, 0);
      pullback.clear();
      if (dense) {
        pullback.dense_field(kLane, 0, weights);
      } else {
        Numbers tiles(at.frame.values().size());
        const auto points = points_by_tile(model, 0);
        for (std::size_t t = 0; t < points.size(); ++t)
          for (const TilePoint& p : points[t])
            for (std::size_t k = 0; k < 3; ++k)
              tiles[(3 * t + k) * kTilePoints + std::size_t(p.place)] =
                  weights[std::size_t(3 * p.point) + k];
        pullback.field(kLane, 0, at.frame.tiles(), tiles);
      }
      pullback.finish(c);
      double back = 0;
      for (std::size_t i = 0; i < nv; ++i)
        back += c.q[i * kBlock + kLane] * dq[i] + c.v[i * kBlock + kLane] * dv[i];
      const double along = std::inner_product(weights.begin(), weights.end(), duals.begin(), 0.0);
      EXPECT_NEAR(along, back, 1e-12 * size * std::sqrt(double(weights.size())));
    }

    // Rounding passes derivatives straight through.
    Read coarse(rounded, s);
    Numbers same(duals.size());
    Tangent(rounded).field(coarse.batch, 0, kLane, coarse.tape, 0, 0, {}, {}, d, same);
    EXPECT_EQ(same, duals);
    EXPECT_NE(coarse.field(), here);
  }
  EXPECT_GT(seen, 1e-3);
  EXPECT_GT(flat, 50);
}

INSTANTIATE_TEST_SUITE_P(Pads, ImperfectGradient,
                         ::testing::Values(Pad::flat, Pad::skewed, Pad::curved));

TEST(ImperfectGradient, SensorsWithMemoryAreRefused) {
  Scene scene = scene_with(Pad::flat, 0);
  scene.sensors[0].imperfections.delay = 0.01;
  scene.sensors[0].imperfections.source = {"x.xml", 3};
  const Model model(scene);
  Random random(11);
  Read at(model, testing::random_pad_state(model, random));
  const Numbers zero(std::size_t(model.nv()));
  Numbers field(at.frame.dense_size());
  EXPECT_THROW(
      Tangent(model).field(at.batch, 0, kLane, at.tape, 0, 0, {}, {}, {zero, zero, {}, {}}, field),
      InputError);
  ReadoutPullback pullback(model);
  pullback.place(at.batch, 0);
  pullback.clear();
  EXPECT_THROW(pullback.dense_field(kLane, 0, field), InputError);
  try {
    check_has_no_lag(model);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              "x.xml:3: derivatives of sensor 'skin', which has low_pass, hysteresis or delay; "
              "expected a sensor without them");
  }
}

}  // namespace
}  // namespace tangere
