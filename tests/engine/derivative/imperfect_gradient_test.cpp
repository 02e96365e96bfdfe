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

/// A pad on a moving shape, with everything that makes a reading late. It starts pressed in.
Scene late_scene(Pad pad) {
  Scene s = scene_with(pad, 0);
  SensorImperfections& i = s.sensors[0].imperfections;
  i.delay = 1.5 * s.timestep, i.low_pass = 1.2 * s.timestep;
  i.hysteresis = 0.3, i.hysteresis_time = 2 * s.timestep;
  i.dead = 0, i.saturation = {0.5, 0.3};
  return s;
}

/// Readings depend on the states of the steps before, and those of the first steps on the start.
TEST(LateReading, ThreeRoutesAgree) {
  constexpr int kLateSteps = 7;
  for (const Pad pad : {Pad::flat, Pad::curved}) {
    const Scene scene = late_scene(pad);
    const Model model(scene);
    ASSERT_GT(model.sensors()[0].past_states, 4);
    const StepperOptions options = testing::options(Integrator::bdf1, scene.timestep, 1e-13);
    Random random(4);
    const PadState s = testing::random_pad_state(model, random);
    testing::RunInput in = testing::random_input(model, 3, kLateSteps);
    in.q = s.q;
    for (std::size_t i = 0; i < in.v.size(); ++i) in.v[i] = 0.1 * s.v[i];
    const testing::FieldLoss loss(model, kLateSteps, 7);
    std::vector<double> by_points;
    const testing::RunGradient adjoint =
        testing::adjoint_of_fields(model, options, in, loss, &by_points);
    EXPECT_GT(testing::norm(adjoint.q), 1e-3);
    const auto along = [&](const std::function<void(testing::RunInput&, double)>& change) {
      return testing::best_difference(
          [&](double e) {
            testing::RunInput other = in;
            change(other, e);
            return testing::field_loss_of_run(model, options, other, loss);
          },
          1e-6);
    };
    testing::RunGradient difference;
    for (int i = 0; i < model.nv(); ++i) {
      difference.q.push_back(
          along([&](testing::RunInput& x, double e) { x.q = testing::moved(model, x.q, i, e); }));
      difference.v.push_back(
          along([&](testing::RunInput& x, double e) { x.v[std::size_t(i)] += 1e2 * e; }) / 1e2);
    }
    int compared =
        testing::compare(adjoint.q, difference.q, testing::norm(difference.q), 1e-5, "q");
    compared += testing::compare(adjoint.v, difference.v, testing::norm(difference.v), 1e-5, "v");
    EXPECT_GT(compared, model.nv());
    EXPECT_GT(testing::norm(difference.v), 1e-4);
    testing::expect_tangent(model, options, in, adjoint, random, testing::change_of_fields(loss));
  }
}

/// A sensor without imperfections reads what its ideal field is; the cotangent of a pressure of an
/// imperfect one goes through its flaws.
TEST(ImperfectGradient, PressuresMatchDifferences) {
  for (const Pad pad : {Pad::flat, Pad::curved}) {
    const Model model(late_scene(pad));
    Random random(5);
    const auto points = std::size_t(model.sensors()[0].points), nv = std::size_t(model.nv());
    const Numbers weights = random_numbers(random, points, 1);
    int compared = 0;
    for (int trial = 0; trial < 4; ++trial) {
      const PadState s = testing::random_pad_state(model, random);
      const auto value = [&](const PadState& at) {
        Batch batch(model, 1);
        batch.set_state(0, at.q, at.v);
        DenseFrame<double> frame(model, 0, FieldForm::pressure);
        Readout(model).read(batch, 0, frame);
        return std::inner_product(weights.begin(), weights.end(), frame.values().begin(), 0.0);
      };
      Batch batch(model, 1);
      batch.set_state(0, s.q, s.v);
      ReadoutPullback pullback(model);
      BlockCotangent c;
      for (auto* x : {&c.q, &c.v}) x->assign(nv * kBlock, 0.0);
      pullback.place(batch, 0);
      pullback.clear();
      pullback.pressure(0, 0, weights);
      pullback.finish(c);
      double norm = 0;
      for (std::size_t i = 0; i < nv; ++i) norm += c.q[i * kBlock] * c.q[i * kBlock];
      for (std::size_t i = 0; i < nv; ++i) {
        const auto moved = [&](double e) {
          return value({testing::moved(model, s.q, int(i), e), s.v});
        };
        const double difference = testing::best_difference(moved, 1e-6);
        if (!std::isfinite(difference) || norm == 0) continue;
        ++compared;
        EXPECT_NEAR(c.q[i * kBlock], difference, 1e-4 * std::sqrt(norm)) << trial << " " << i;
      }
    }
    EXPECT_GT(compared, 10);
  }
}

/// The tangent along one direction of one state refuses a reading of several.
TEST(ImperfectGradient, FieldTangentsOfLateSensorsAreRefused) {
  Scene scene = late_scene(Pad::flat);
  scene.sensors[0].imperfections.source = {"x.xml", 3};
  const Model model(scene);
  Random random(11);
  Read at(model, testing::random_pad_state(model, random));
  Numbers change(at.frame.values().size());
  FieldTangent tangent(model);
  tangent.place(at.batch, 0);
  try {
    tangent.field(0, at.frame.tiles(), change);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              "x.xml:3: derivatives of sensor 'skin', which has low_pass, hysteresis or delay; "
              "expected a sensor without them");
  }
}

}  // namespace
}  // namespace tangere
