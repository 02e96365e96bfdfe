// SPDX-License-Identifier: Apache-2.0
// Tests the imperfections of sensors against closed forms: moments of noise, the grid of rounded
// readings, sums that crosstalk and spread keep, fields of earlier states; and that every way of
// reading gives the same bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>

#include "engine/model/random_run.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/effects/ablation.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using kernels::kBlock;
using testing::Pad;
using testing::Random;
using Numbers = std::vector<double>;

/// A sphere in a pad of 11 × 13 points, or a list of 150.
Scene imperfect_scene(const std::function<void(SensorImperfections&)>& set, Pad pad = Pad::flat,
                      int side = 0) {
  Scene s = testing::pad_scene(PrimitiveShape::sphere, ContactLaw::clamped, pad);
  set(s.sensors[0].imperfections);
  if (side > 0) s.sensors[0].array.rows = s.sensors[0].array.cols = side;
  return s;
}

/// Puts environments into states in which the sphere touches.
void touch(Batch& batch) {
  Random random(7);
  for (int e = 0; e < batch.environments(); ++e) {
    const testing::PadState s = testing::random_pad_state(batch.model(), random);
    batch.set_state(e, s.q, s.v);
  }
}

Numbers field_of(const Batch& batch, int environment, FieldForm form = FieldForm::field) {
  const Model& model = batch.model();
  Numbers all(kBlock * numbers_of(model.sensors()[0].points, form));
  std::vector<std::span<double>> places;
  for (std::size_t e = 0; e < kBlock; ++e)
    places.push_back(std::span(all).subspan(e * all.size() / kBlock, all.size() / kBlock));
  Readout(model).read_block(batch, environment / kBlock, {0, form},
                            std::span<const std::span<double>>(places));
  const std::span<double> own = places[std::size_t(environment % kBlock)];
  return {own.begin(), own.end()};
}

struct Moments {
  double mean = 0, deviation = 0, correlation = 0;  ///< the last: of neighbours
};
Moments moments_of(const Numbers& x) {
  Moments m;
  for (const double a : x) m.mean += a / double(x.size());
  double next = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    m.deviation += (x[i] - m.mean) * (x[i] - m.mean) / double(x.size());
    next += (x[i] - m.mean) * (x[(i + 1) % x.size()] - m.mean) / double(x.size());
  }
  m.correlation = next / m.deviation;
  m.deviation = std::sqrt(m.deviation);
  return m;
}

/// Five standard errors of a mean, a deviation and a correlation of n normal numbers.
void expect_normal(const Numbers& x, double deviation) {
  const Moments m = moments_of(x);
  const double bound = 5 / std::sqrt(double(x.size()));
  EXPECT_NEAR(m.mean, 0, bound * deviation);
  EXPECT_NEAR(m.deviation, deviation, bound * deviation);
  EXPECT_NEAR(m.correlation, 0, bound);
}

TEST(RandomRun, WordsAreThoseOfTheGenerator) {
  const RandomKey key{0x123456789abcdef, 1234567890123, 98765, Purpose::sensor_noise, 4711};
  RandomWords words;
  random_run(key, words);
  for (std::size_t l = 0; l < kRandomRun; ++l) {
    RandomKey one = key;
    one.index += std::uint32_t(l);
    const PhiloxCounter at = counter_of(one);
    const auto expected = philox4x32(at.counter, at.key);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(words[k][l], expected[k]) << l;
  }
}

TEST(RandomRun, NormalNumbersAreThoseOfBoxAndMuller) {
  RandomWords words;
  RandomNormals z;
  for (std::uint32_t run = 0; run < 200; ++run) {
    random_run({5, run, 0, Purpose::sensor_noise, 0}, words);
    constexpr std::uint32_t kCorners[] = {0,          1,          0x1fffffff, 0x20000000,
                                          0x3fffffff, 0x5fffffff, 0x60000000, 0x7fffffff,
                                          0x80000000, 0xa0000000, 0xe0000000, 0xffffffff};
    for (std::size_t k = 0; run == 0 && k < std::size(kCorners); ++k)
      words[0][k] = words[1][std::size(kCorners) - 1 - k] = kCorners[k];
    normal_run(words, z);
    for (std::size_t l = 0; l < kRandomRun; ++l)
      for (std::size_t k = 0; k < 4; k += 2) {
        const double radius = std::sqrt(-2 * std::log((double(words[k][l] >> 1) + 0.5) * 0x1p-31)),
                     angle = 2 * std::numbers::pi * words[k + 1][l] * 0x1p-32;
        // Close to 1 the logarithm's argument has 24 bits.
        const double bound = 2e-6 * (1 + radius) + 1e-7 / std::max(radius, 3e-4);
        EXPECT_NEAR(double(z[k][l]), radius * std::cos(angle), bound);
        EXPECT_NEAR(double(z[k + 1][l]), radius * std::sin(angle), bound);
      }
  }
}

TEST(RandomRun, NormalNumbersHaveTheirMoments) {
  RandomWords words;
  RandomNormals z;
  double sums[4] = {}, n = 0, beyond = 0;
  for (std::uint32_t run = 0; run < 4000; ++run) {
    random_run({5, 1, run, Purpose::sensor_noise, 0}, words);
    normal_run(words, z);
    for (const auto& row : z)
      for (const float x : row) {
        for (int k = 0; k < 4; ++k) sums[k] += std::pow(double(x), k + 1);
        beyond += std::abs(x) > 3 ? 1 : 0;
        ++n;
      }
  }
  // Five standard errors of each moment of a normal number.
  EXPECT_NEAR(sums[0] / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(sums[1] / n, 1, 5 * std::sqrt(2 / n));
  EXPECT_NEAR(sums[2] / n, 0, 5 * std::sqrt(15 / n));
  EXPECT_NEAR(sums[3] / n, 3, 5 * std::sqrt(96 / n));
  EXPECT_NEAR(beyond / n, 0.0026998, 5 * std::sqrt(0.0027 / n));
}

TEST(Imperfections, NoiseIsWhiteAndNewInEveryStep) {
  const Model model(imperfect_scene([](auto& i) { i.noise = {0.003, 0.001}; }));
  Batch batch(model, 40, 3);
  Numbers shear, normal, next, both;
  for (int e = 0; e < 40; ++e) {
    const Numbers ideal = field_of(batch, e, FieldForm::ideal), first = field_of(batch, e);
    EXPECT_EQ(first, field_of(batch, e));
    batch.set_steps(e, 1);
    const Numbers second = field_of(batch, e);
    for (std::size_t i = 0; i < ideal.size(); ++i) {
      (i % 3 == 2 ? normal : shear).push_back(first[i] - ideal[i]);
      if (i % 3 == 2) next.push_back(second[i] - ideal[i]);
    }
  }
  expect_normal(shear, 0.001);
  expect_normal(normal, 0.003);
  expect_normal(next, 0.003);
  for (std::size_t i = 0; i < next.size(); ++i) both.push_back(normal[i] + next[i]);
  expect_normal(both, 0.003 * std::sqrt(2.0));
  EXPECT_NE(normal, next);
}

TEST(Imperfections, BiasAndGainBelongToThePointAndTheEpisode) {
  const Model offset(imperfect_scene([](auto&i) {
    i.bias = {0.02, 0.01};
  })),
      scaled(imperfect_scene([](auto&i) { i.gain = 0.1; }));
  Batch a(offset, 60, 3), b(scaled, 60, 3);
  touch(a), touch(b);
  Numbers normal, shear, gain;
  std::set<double> first;
  for (int e = 0; e < 60; ++e) {
    const Numbers ideal = field_of(a, e, FieldForm::ideal), moved = field_of(a, e),
                  stretched = field_of(b, e);
    for (std::size_t i = 0; i < ideal.size(); ++i)
      (i % 3 == 2 ? normal : shear).push_back(moved[i] - ideal[i]);
    first.insert(normal[normal.size() - ideal.size() / 3]);
    for (std::size_t p = 0; p < ideal.size() / 3; ++p) {
      if (std::abs(ideal[3 * p + 2]) < 1e-4) continue;
      gain.push_back(stretched[3 * p + 2] / ideal[3 * p + 2] - 1);
      for (std::size_t c = 0; c < 2; ++c)  // one gain for all three
        EXPECT_NEAR(stretched[3 * p + c], (1 + gain.back()) * ideal[3 * p + c], 1e-12);
    }
    a.set_steps(e, 17), b.set_steps(e, 17);
    EXPECT_EQ(field_of(a, e), moved);
    EXPECT_EQ(field_of(b, e), stretched);
  }
  expect_normal(normal, 0.02);
  expect_normal(shear, 0.01);
  ASSERT_GT(gain.size(), 500U);
  expect_normal(gain, 0.1);
  EXPECT_EQ(first.size(), 60U);
}

TEST(Imperfections, TheSensorsGainIsOneNumberOfAnEpisode) {
  const Model model(imperfect_scene([](auto& i) { i.sensor_gain = 0.2; }));
  Batch batch(model, 400, 3);
  Numbers gain;
  for (int e = 0; e < 400; ++e) {
    const Numbers ideal = field_of(batch, e, FieldForm::ideal), read = field_of(batch, e);
    const auto peak = std::max_element(ideal.begin(), ideal.end(),
                                       [](double a, double b) { return a * a < b * b; });
    ASSERT_NE(*peak, 0);
    const double factor = read[std::size_t(peak - ideal.begin())] / *peak;
    for (std::size_t i = 0; i < ideal.size(); ++i)
      EXPECT_NEAR(read[i], factor * ideal[i], 1e-14 * std::abs(*peak));
    gain.push_back(factor - 1);
  }
  expect_normal(gain, 0.2);
}

TEST(Imperfections, DeadPointsReadZeroForTheEpisode) {
  const Model model(imperfect_scene([](auto& i) {
    i.dead = 0.05;
    i.bias = {1, 1};
    i.noise = {1, 1};
  }));
  Batch batch(model, 40, 3);
  double dead = 0, all = 0;
  for (int e = 0; e < 40; ++e) {
    const Numbers first = field_of(batch, e);
    batch.set_steps(e, 5);
    const Numbers later = field_of(batch, e);
    for (std::size_t p = 0; p < first.size() / 3; ++p, ++all) {
      const bool zero = first[3 * p] == 0;
      dead += zero ? 1 : 0;
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_EQ(first[3 * p + c] == 0, zero);
        EXPECT_EQ(later[3 * p + c] == 0, zero);
      }
    }
  }
  EXPECT_NEAR(dead / all, 0.05, 5 * std::sqrt(0.05 * 0.95 / all));
}

TEST(Imperfections, SaturationAndQuantisationAreExact) {
  const Model model(imperfect_scene([](auto& i) {
    i.noise = {0.05, 0.05};
    i.saturation = {0.06, 0.03};
    i.quantisation = {0.004, 0};
  }));
  const Model loud(imperfect_scene([](auto& i) { i.noise = {0.05, 0.05}; }));
  Batch batch(model, 8, 3), same(loud, 8, 3);
  touch(batch), touch(same);
  int clipped = 0;
  for (int e = 0; e < 8; ++e) {
    const Numbers read = field_of(batch, e), before = field_of(same, e);
    for (std::size_t i = 0; i < read.size(); ++i) {
      const double limit = i % 3 == 2 ? 0.06 : 0.03, x = std::clamp(before[i], -limit, limit);
      clipped += x != before[i] ? 1 : 0;
      if (i % 3 != 2) {
        EXPECT_EQ(read[i], x);
        continue;
      }
      const double k = std::round(read[i] / 0.004);
      EXPECT_EQ(read[i], 0.004 * k);
      EXPECT_LE(std::abs(read[i] - x), 0.002 * (1 + 1e-12));
    }
  }
  EXPECT_GT(clipped, 100);
}

/// A converter whose range is no multiple of its step never reads beyond its range.
TEST(Imperfections, RoundedReadingsStayBelowSaturation) {
  for (const double limit : {0.0585, 0.0615, 0.0599999}) {
    const Model model(imperfect_scene([&](auto& i) {
      i.noise = {0.05, 0.05};
      i.saturation = {limit, limit};
      i.quantisation = {0.004, 0.004};
    }));
    Batch batch(model, 4, 3);
    touch(batch);
    double most = 0;
    for (int e = 0; e < 4; ++e)
      for (const double x : field_of(batch, e)) most = std::max(most, std::abs(x));
    EXPECT_EQ(most, 0.004 * std::floor(limit / 0.004)) << limit;
  }
}

/// Against plain loops over pairs of points.
TEST(Imperfections, CrosstalkAndSpreadKeepTheSum) {
  const double c = 0.08, width = 0.006;
  const Model model(imperfect_scene([&](auto& i) {
    i.crosstalk = c;
    i.spread = width;
  }));
  const double pitch0 = 0.05 / 10, pitch1 = 0.05 / 12;
  Batch batch(model, 18, 3);
  touch(batch);
  int touched = 0;
  for (int e = 0; e < 18; ++e) {
    const Numbers ideal = field_of(batch, e, FieldForm::ideal), read = field_of(batch, e);
    constexpr int kRows = 11, kCols = 13;
    const auto weight = [&](int way, double pitch) {
      return way * pitch > 4 * width ? 0 : std::exp(-0.5 * std::pow(way * pitch / width, 2));
    };
    Numbers spread(ideal.size()), expected(ideal.size());
    for (int i = 0; i < kRows; ++i)
      for (int j = 0; j < kCols; ++j) {
        double sum = 0;
        for (int a = 0; a < kRows; ++a)
          for (int b = 0; b < kCols; ++b)
            sum += weight(std::abs(a - i), pitch0) * weight(std::abs(b - j), pitch1);
        for (int a = 0; a < kRows; ++a)
          for (int b = 0; b < kCols; ++b)
            for (int k = 0; k < 3; ++k)
              spread[std::size_t(3 * (a * kCols + b) + k)] +=
                  weight(std::abs(a - i), pitch0) * weight(std::abs(b - j), pitch1) / sum *
                  ideal[std::size_t(3 * (i * kCols + j) + k)];
      }
    double peak = 0, sums[3] = {}, ideal_sums[3] = {};
    for (int i = 0; i < kRows; ++i)
      for (int j = 0; j < kCols; ++j)
        for (int k = 0; k < 3; ++k) {
          const auto at = [&](int a, int b) {
            return spread[std::size_t(3 * (a * kCols + b) + k)];
          };
          double x = at(i, j);
          for (const auto& [a, b] :
               {std::pair(i - 1, j), std::pair(i + 1, j), std::pair(i, j - 1), std::pair(i, j + 1)})
            if (a >= 0 && a < kRows && b >= 0 && b < kCols) x += c * (at(a, b) - at(i, j));
          const auto number = std::size_t(3 * (i * kCols + j) + k);
          expected[number] = x;
          sums[k] += read[number], ideal_sums[k] += ideal[number];
          peak = std::max(peak, std::abs(ideal[number]));
        }
    touched += peak > 1e-3 ? 1 : 0;
    for (std::size_t i = 0; i < read.size(); ++i) EXPECT_NEAR(read[i], expected[i], 1e-13 * peak);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(sums[k], ideal_sums[k], 1e-12 * peak);
    const auto moved = [](const Numbers& x) {
      return std::count_if(x.begin(), x.end(), [](double a) { return a != 0; });
    };
    EXPECT_TRUE(peak == 0 || moved(read) > moved(ideal));
  }
  EXPECT_GT(touched, 4);
}

void set_all(SensorImperfections& i, bool grid) {
  if (grid) i.crosstalk = 0.05, i.spread = 0.004;
  i.gain = 0.05, i.sensor_gain = 0.02, i.dead = 0.03;
  i.bias = {0.002, 0.001}, i.noise = {0.003, 0.002};
  i.saturation = {0.08, 0.05}, i.quantisation = {0.0005, 0.0005};
}

class EveryWay : public ::testing::TestWithParam<std::tuple<Pad, int, Precision, bool>> {};

/// Whole field, its parts, every kind of frame, alone and in a batch, in any lane.
TEST_P(EveryWay, GivesTheSameBits) {
  const auto [pad, side, precision, memory] = GetParam();
  const Model model(imperfect_scene(
      [pad = pad, memory = memory](auto& i) {
        set_all(i, pad != Pad::curved);
        if (memory) i.delay = 0.012, i.low_pass = 0.02;  // more states than lanes
      },
      pad, side));
  Batch batch(model, 20, 3, 100);
  touch(batch);
  Stepper stepper(model);
  const Numbers u(20 * std::size_t(model.nu()));
  for (int k = 0; k < 6; ++k) stepper.step(batch, u);
  Readout readout(model, precision);
  const int points = model.sensors()[0].points;
  const auto n = std::size_t(points);
  const auto block = [&](int b, FieldForm form) {
    std::vector<Numbers> all(kBlock, Numbers(numbers_of(points, form), -3));
    std::vector<std::span<double>> places(all.begin(), all.end());
    readout.read_block(batch, b, {0, form}, std::span<const std::span<double>>(places));
    return all;
  };
  DenseFrame<double> dense(model, 0), pressures(model, 0, FieldForm::pressure);
  CompactFrame<double> compact(model, 0);
  CompactFrame<float> narrow(model, 0);
  for (int b = 0; b < 2; ++b) {
    const auto fields = block(b, FieldForm::field), pressure = block(b, FieldForm::pressure),
               shear = block(b, FieldForm::shear), sum = block(b, FieldForm::sum);
    for (int e = 16 * b; e < std::min(20, 16 * b + 16); ++e) {
      const Numbers& field = fields[std::size_t(e % 16)];
      Numbers one(3 * n), spread(3 * n);
      readout.tactile(batch, e, 0, one);
      EXPECT_EQ(one, field) << e;
      readout.read(batch, e, dense);
      EXPECT_TRUE(std::equal(field.begin(), field.end(), dense.values().begin()));
      readout.read(batch, e, compact);
      compact.expand(spread);
      EXPECT_EQ(spread, field);
      readout.read(batch, e, narrow);
      std::vector<float> floats(3 * n);
      narrow.expand(floats);
      for (std::size_t i = 0; i < 3 * n; ++i) EXPECT_EQ(floats[i], float(field[i]));
      for (std::size_t p = 0; p < n; ++p)
        for (std::size_t c = 0; c < 2; ++c)
          EXPECT_EQ(shear[std::size_t(e % 16)][2 * p + c], field[3 * p + c]);
      readout.read(batch, e, pressures);
      EXPECT_TRUE(std::equal(pressures.values().begin(), pressures.values().end(),
                             pressure[std::size_t(e % 16)].begin()));
      EXPECT_NE(sum[std::size_t(e % 16)][2], 0);
      // Alone, in another lane of another batch that took the same steps.
      Batch other(model, 5, 3, 100 + e - 4);
      other.set_state(4, testing::q_of(batch, e), testing::v_of(batch, e));
      other.set_steps(4, batch.steps(e));
      if (memory) continue;  // the other one has not the same past
      Readout(model, precision).tactile(other, 4, 0, one);
      EXPECT_EQ(one, field) << e;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Pads, EveryWay,
                         ::testing::Combine(::testing::Values(Pad::flat, Pad::curved),
                                            ::testing::Values(0, 30),
                                            ::testing::Values(Precision::f64, Precision::mixed),
                                            ::testing::Bool()));

TEST(Imperfections, TheSumIsThatOfTheReading) {
  for (const Pad pad : {Pad::flat, Pad::curved}) {
    const Scene scene = imperfect_scene([&](auto& i) { set_all(i, pad == Pad::flat); }, pad);
    const Model model(scene);
    Batch batch(model, 3, 3);
    touch(batch);
    for (int e = 0; e < 3; ++e) {
      const Numbers field = field_of(batch, e), sum = field_of(batch, e, FieldForm::sum);
      Vector3 force{};
      const TactileDescription& d = scene.sensors[0];
      for (std::size_t p = 0; p < field.size() / 3; ++p) {
        const Vector3 a = pad == Pad::flat ? d.array.axis0 : d.points[p].axis0,
                      b = pad == Pad::flat ? d.array.axis1 : d.points[p].axis1,
                      n = pad == Pad::flat ? Vector3{0, 0, 1} : d.points[p].normal;
        for (std::size_t k = 0; k < 3; ++k)
          force[k] += field[3 * p] * a[k] + field[3 * p + 1] * b[k] - field[3 * p + 2] * n[k];
      }
      for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(sum[k], force[k], 1e-12) << k;
    }
  }
}

TEST(Imperfections, OffIsIdealToTheBit) {
  const Scene ideal = imperfect_scene([](auto&) {});
  Scene named = ideal, on = imperfect_scene([](auto&i) { set_all(i, true); });
  named.sensors[0].imperfections.source = {"x.xml", 3};
  EXPECT_FALSE(Model(named).sensors()[0].imperfect);
  EXPECT_TRUE(Model(on).sensors()[0].imperfect);
  const auto read = [](const Scene& scene) {
    Batch batch(Model(scene), 2, 3);
    touch(batch);
    return field_of(batch, 1);
  };
  const Numbers expected = read(ideal);
  EXPECT_EQ(read(named), expected);
  EXPECT_NE(read(on), expected);
  for (const Ablation way : {Ablation::removed, Ablation::zero})
    EXPECT_EQ(read(without(on, {EffectKind::sensor_imperfections}, way)), expected);
}

TEST(Imperfections, StepsCountWhatAnEpisodeHasTaken) {
  const Model model(imperfect_scene([](auto& i) { i.noise = {1, 1}; }));
  Batch batch(model, 18, 3);
  Stepper stepper(model);
  const Numbers u(18 * std::size_t(model.nu()));
  batch.hold(2);
  for (int k = 0; k < 3; ++k) stepper.step(batch, u);
  EXPECT_EQ(batch.steps(0), 3);
  EXPECT_EQ(batch.steps(2), 0);
  const BlockState saved = batch.save_block(0);
  stepper.step(batch, u);
  EXPECT_EQ(batch.steps(0), 4);
  batch.restore_block(0, saved);
  EXPECT_EQ(batch.steps(0), 3);
  EXPECT_EQ(batch.steps(17), 4);
  batch.reset(0, 7);
  EXPECT_EQ(batch.steps(0), 0);
  batch.set_failed(1, StepStatus::singular);
  stepper.step(batch, u);
  EXPECT_EQ(batch.steps(1), 3);
}

/// What a sensor with memory should say: the mean of ideal fields kept by hand. One state, few or
/// more than a block has lanes; pads whose lanes are environments or points.
TEST(Imperfections, MemoryIsAMeanOfEarlierFields) {
  const double h = 0.005;
  struct Case {
    double delay, low_pass;
    int side = 0;
  };
  for (const Case c : {Case{0.01, 0}, Case{0.0125, 0}, Case{0, 0.008}, Case{0.011, 0.004},
                       Case{0.0125, 0.02}, Case{0.0125, 0.02, 30}}) {
    SCOPED_TRACE(std::to_string(c.delay) + " " + std::to_string(c.low_pass));
    Scene scene = imperfect_scene([&](auto& i) { i.delay = c.delay, i.low_pass = c.low_pass; },
                                  Pad::flat, c.side);
    scene.timestep = h;
    const Model model(scene);
    Batch batch(model, 18, 3);
    touch(batch);
    Stepper stepper(model);
    const Numbers u(18 * std::size_t(model.nu()));
    const int steps = 49;
    const auto peak = [&](int e) {
      double most = 0;
      for (const double x : field_of(batch, e, FieldForm::ideal))
        most = std::max(most, std::abs(x));
      return most;
    };
    int e = 17;
    while (e > 0 && peak(e) < 1e-3) --e;
    std::vector<Numbers> ideal = {field_of(batch, e, FieldForm::ideal)};
    const auto at = [&](int k) -> const Numbers& { return ideal[std::size_t(std::max(k, 0))]; };
    double change = 0;
    for (int t = 1; t <= steps; ++t) {
      stepper.step(batch, u);
      ideal.push_back(field_of(batch, e, FieldForm::ideal));
      if (t % 7 != 0) continue;  // nobody looked in between
      const int whole = int(std::floor(c.delay / h + 1e-9));
      const double part = c.delay / h - whole,
                   beta = c.low_pass > 0 ? std::exp(-h / c.low_pass) : 0;
      Numbers expected(ideal[0].size());
      double total = 0;
      for (int k = 0; k == 0 || (beta > 0 && std::pow(beta, k) > 1e-3); ++k)
        total += std::pow(beta, k);
      for (int k = 0; k == 0 || (beta > 0 && std::pow(beta, k) > 1e-3); ++k)
        for (std::size_t i = 0; i < expected.size(); ++i)
          expected[i] += std::pow(beta, k) / total *
                         ((1 - part) * at(t - whole - k)[i] +
                          (part > 1e-9 ? part * at(t - whole - k - 1)[i] : 0));
      const Numbers read = field_of(batch, e);
      for (std::size_t i = 0; i < read.size(); ++i) {
        ASSERT_NEAR(read[i], expected[i], 1e-14) << t;
        change = std::max(change, std::abs(read[i] - at(t)[i]));
      }
    }
    EXPECT_GT(change, 1e-5);
  }
}

TEST(Imperfections, ValuesOutOfRangeAreRefused) {
  const auto refused = [](const std::function<void(SensorImperfections&)>& set, Pad pad,
                          const std::string& text) {
    Scene scene = imperfect_scene(set, pad);
    scene.sensors[0].imperfections.source = {"x.xml", 3};
    try {
      const Model model(scene);
      ADD_FAILURE() << "accepted: " << text;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find("x.xml:3: imperfections of 'skin': "), 0U);
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  };
  refused([](auto& i) { i.noise.shear = -1; }, Pad::flat, "noise=\"-1\"; expected zero or more");
  refused([](auto& i) { i.bias.normal = NAN; }, Pad::flat, "bias");
  refused([](auto& i) { i.saturation.normal = INFINITY; }, Pad::flat, "saturation");
  refused([](auto& i) { i.dead = 1.5; }, Pad::flat, "dead=\"1.5\"; expected a number from 0 to 1");
  refused([](auto& i) { i.crosstalk = 0.3; }, Pad::flat, "0 to 0.25");
  refused([](auto& i) { i.crosstalk = 0.1; }, Pad::curved, "crosstalk on a list of points");
  refused([](auto& i) { i.spread = 0.1; }, Pad::curved, "spread on a list of points");
  refused([](auto& i) { i.hysteresis = 0.1; }, Pad::flat,
          "hysteresis=\"0.1\" with hysteresis_time=\"0\" s; expected both above 0, or neither");
  refused([](auto& i) { i.hysteresis_time = 0.1; }, Pad::flat, "expected both above 0");
  refused([](auto& i) { i.hysteresis = 1.5, i.hysteresis_time = 0.1; }, Pad::flat, "from 0 to 1");
  refused([](auto& i) { i.hysteresis = 0.5, i.hysteresis_time = 100; }, Pad::flat,
          "steps of 0.005 s back");
  refused([](auto& i) { i.delay = 100; }, Pad::flat, "steps of 0.005 s back; expected less than");
}

}  // namespace
}  // namespace tangere
