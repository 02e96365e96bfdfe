// SPDX-License-Identifier: Apache-2.0
// Tests what the hardware of a sensor returns: loads of nodes, the map, its pullback and flaws.
#include "engine/sense/channel_reading.hpp"

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
constexpr int kSkinRows = 9, kSkinCols = 7, kOutputs = 5;

ChannelMap random_map(int rows, int cols, bool shear, unsigned seed = 4) {
  testing::Random random(seed);
  ChannelMap map;
  map.unit = "uT";
  map.rows = rows, map.cols = cols, map.shear = shear;
  for (int c = 0; c < kOutputs; ++c) {
    map.names.push_back("b" + std::to_string(c));
    map.offset.push_back(10 * random.normal());
  }
  for (std::size_t k = 0; k < kOutputs * map.loads(); ++k)
    map.linear.push_back(30 * random.normal());
  for (std::size_t k = 0; k < kOutputs * map.pairs(); ++k)
    map.quadratic.push_back(20 * random.normal());
  return map;
}

/// A ball that slides on a skin. `turned`: axis0 × axis1 points into the skin.
Scene pressed_skin(const ChannelMap& map, bool turned = false) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.timestep = 1e-2;
  s.links = {testing::link("plate", JointType::fixed, {0, 0, -0.005},
                           CuboidShape{{0.02, 0.02, 0.01}, {2, 2, 2}}, 1000),
             testing::link("ball", JointType::translational, {1e-3, -7e-4, 5e-3}, SphereShape{5e-3},
                           1000)};
  TactileDescription t;
  t.name = "skin";
  t.body = "plate";
  t.source = {"skin.xml", 9};
  t.array = {
      {-0.004, -0.003, 0.005}, {0.004, 0.003, 0.005}, {1, 0, 0}, {0, 1, 0}, kSkinRows, kSkinCols};
  if (turned) std::swap(t.array.corner0[1], t.array.corner1[1]), t.array.axis1 = {0, -1, 0};
  t.coefficients = {400, 200, 0.8, 0};
  t.channels.emplace();
  t.channels->source = {"skin.xml", 10};
  t.channels->map = std::make_shared<const ChannelMap>(map);
  s.sensors.push_back(t);
  return s;
}

Batch pressed(const Model& model, int environments = 1) {
  Batch batch(model, environments, 3);
  for (int e = 0; e < environments; ++e)
    batch.set_state(e, Numbers{0, 0, -0.6e-3}, Numbers{0.01, 0.02, 0});
  return batch;
}

Numbers read(const Model& model, const Batch& batch, FieldForm form, int environment = 0) {
  Numbers out(numbers_of(model.sensors()[0], form));
  std::vector<Numbers> all(std::size_t(batch.environments()), out);
  const std::vector<std::span<double>> to(all.begin(), all.end());
  Readout(model).read_block(batch, 0, {0, form}, to);
  return all[std::size_t(environment)];
}

/// Loads by their definition: a hat at each node, one after the other.
TEST(ChannelReading, FollowsTheEquationOfThePage) {
  for (const bool turned : {false, true})
    for (const bool shear : {false, true})
      for (const auto& [rows, cols] : {std::pair{1, 1}, {3, 2}, {2, 4}}) {
        const ChannelMap map = random_map(rows, cols, shear);
        const Model model(pressed_skin(map, turned));
        const Batch batch = pressed(model);
        const Numbers field = read(model, batch, FieldForm::field),
                      found = read(model, batch, FieldForm::channels);
        ASSERT_EQ(found.size(), std::size_t(kOutputs));
        const auto hat = [](int point, int points, int node, int nodes) {
          if (nodes == 1) return 1.0;
          return std::max(0.0, 1 - std::abs(double(point) / (points - 1) * (nodes - 1) - node));
        };
        Numbers x;
        for (int a = 0; a < rows; ++a)
          for (int b = 0; b < cols; ++b)
            for (int k = shear ? 0 : 2; k < 3; ++k) {
              double sum = 0;
              for (int i = 0; i < kSkinRows; ++i)
                for (int j = 0; j < kSkinCols; ++j)
                  sum += hat(i, kSkinRows, a, rows) * hat(j, kSkinCols, b, cols) *
                         field[std::size_t(3 * (kSkinCols * i + j) + k)];
              x.push_back(k == 2 && turned ? -sum : sum);
            }
        EXPECT_GT(*std::ranges::max_element(x), 1e-2);
        for (std::size_t c = 0; c < kOutputs; ++c) {
          double y = map.offset[c];
          for (std::size_t k = 0; k < x.size(); ++k) y += map.linear[c * x.size() + k] * x[k];
          std::size_t pair = c * map.pairs();
          for (std::size_t k = 0; k < x.size(); ++k)
            for (std::size_t l = k; l < x.size(); ++l) y += map.quadratic[pair++] * x[k] * x[l];
          EXPECT_NEAR(found[c], y, 1e-10 * (1 + std::abs(y))) << rows << cols << shear << turned;
        }
      }
}

TEST(ChannelReading, PullsBackItsDifferences) {
  const Model model(pressed_skin(random_map(2, 3, true)));
  const Numbers field = read(model, pressed(model), FieldForm::field);
  const FormMap map(model, {0, FieldForm::channels});
  testing::Random random(8);
  Numbers bar(map.size()), field_bar(field.size());
  for (double& x : bar) x = random.normal();
  map.pull_back(field, bar, field_bar);
  const auto along = [&](const Numbers& way, double e) {
    Numbers moved = field, y(map.size());
    for (std::size_t k = 0; k < field.size(); ++k) moved[k] += e * way[k];
    map.evaluate(moved, y);
    double sum = 0;
    for (std::size_t c = 0; c < y.size(); ++c) sum += bar[c] * y[c];
    return sum;
  };
  for (int trial = 0; trial < 4; ++trial) {
    Numbers way(field.size());
    double expected = 0;
    for (std::size_t k = 0; k < way.size(); ++k)
      way[k] = random.normal(), expected += way[k] * field_bar[k];
    // Exact but for rounding: the map is quadratic.
    EXPECT_NEAR((along(way, 1e-2) - along(way, -1e-2)) / 2e-2, expected,
                1e-9 * (1 + std::abs(expected)));
  }
}

/// Flaws by their definition: a second reading of the same step has the same bits, others differ.
TEST(ChannelReading, FlawsHaveTheirSizes) {
  const ChannelMap map = random_map(1, 1, false);
  const auto with = [&](const auto& set) {
    Scene scene = pressed_skin(map);
    set(*scene.sensors[0].channels);
    return Model(scene);
  };
  const Model ideal = with([](ChannelsDescription&) {});
  const int count = 16;
  const Numbers clean = read(ideal, pressed(ideal, count), FieldForm::channels);
  const auto deviation = [&](const Model& model, std::int64_t steps) {
    Batch batch = pressed(model, count);
    double square = 0;
    for (int e = 0; e < count; ++e) batch.set_steps(e, steps);
    for (int e = 0; e < count; ++e) {
      const Numbers y = read(model, batch, FieldForm::channels, e);
      EXPECT_EQ(y, read(model, batch, FieldForm::channels, e));
      for (std::size_t c = 0; c < y.size(); ++c) square += std::pow(y[c] - clean[c], 2);
    }
    return std::sqrt(square / (count * kOutputs));
  };
  const Model noisy = with([](ChannelsDescription& d) { d.noise = 2; });
  EXPECT_NEAR(deviation(noisy, 0), 2, 0.5);
  EXPECT_NE(deviation(noisy, 0), deviation(noisy, 1));
  const Model biased = with([](ChannelsDescription& d) { d.bias = 3; });
  EXPECT_NEAR(deviation(biased, 0), 3, 0.8);
  EXPECT_EQ(deviation(biased, 0), deviation(biased, 7));
  const Model drifting = with([](ChannelsDescription& d) { d.drift = 5; });
  EXPECT_EQ(deviation(drifting, 0), 0);
  EXPECT_NEAR(deviation(drifting, 100), 5, 1.5);  // after a second
  EXPECT_NEAR(deviation(drifting, 300) / deviation(drifting, 100), 3, 1e-9);
  const Model gained = with([](ChannelsDescription& d) { d.gain = 0.1; });
  double size = 0;
  for (std::size_t c = 0; c < clean.size(); ++c) size += std::pow(clean[c] - map.offset[c], 2);
  EXPECT_NEAR(deviation(gained, 0) / (0.1 * std::sqrt(size / kOutputs)), 1, 0.5);
}

TEST(ChannelReading, CountsAreLimitedMultiples) {
  Scene scene = pressed_skin(random_map(2, 2, false));
  scene.sensors[0].channels->quantisation = 0.5, scene.sensors[0].channels->saturation = 12.3;
  const Model model(scene), ideal(pressed_skin(random_map(2, 2, false)));
  const Numbers y = read(model, pressed(model), FieldForm::channels),
                clean = read(ideal, pressed(ideal), FieldForm::channels);
  for (std::size_t c = 0; c < y.size(); ++c)
    EXPECT_EQ(y[c], 0.5 * std::nearbyint(std::clamp(clean[c], -12.0, 12.0) / 0.5)) << clean[c];
}

/// Imperfections are of the forces; channels have their own flaws.
TEST(ChannelReading, ReadsTheIdealField) {
  Scene scene = pressed_skin(random_map(2, 2, true));
  const Model ideal(scene);
  scene.sensors[0].imperfections.noise = {0.1, 0.1};
  const Model noisy(scene);
  EXPECT_EQ(read(noisy, pressed(noisy), FieldForm::channels),
            read(ideal, pressed(ideal), FieldForm::channels));
}

TEST(ChannelReading, RefusesWhatItCannotCompute) {
  const auto refusal = [](const Scene& scene) -> std::string {
    try {
      const Model model(scene);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  ChannelMap map = random_map(10, 2, false);
  EXPECT_THAT(refusal(pressed_skin(map)),
              HasSubstr("skin.xml:10: channels of 'skin': 10 x 2 nodes on 9 x 7 points"));
  map = random_map(2, 2, false);
  map.linear.pop_back();
  EXPECT_THAT(refusal(pressed_skin(map)), HasSubstr("5 names, 19 linear and 50 quadratic"));
  map = random_map(2, 2, false);
  map.names[1] = map.names[0];
  EXPECT_THAT(refusal(pressed_skin(map)), HasSubstr("two channels of one name"));
  Scene coarse = pressed_skin(random_map(1, 1, false));
  coarse.sensors[0].channels->saturation = 1, coarse.sensors[0].channels->quantisation = 2;
  EXPECT_THAT(refusal(coarse), HasSubstr("every channel is 0"));
  coarse.sensors[0].channels.reset();
  const Model without(coarse);
  EXPECT_THROW(read(without, pressed(without), FieldForm::channels), InputError);
}

}  // namespace
}  // namespace tangere
