// SPDX-License-Identifier: Apache-2.0
// Compares derivatives of pictures of springs by the state and by the size of a ball with
// differences, in double precision.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/derivative/readout_pullback.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/sense/pad_reader.hpp"
#include "engine/sense/picture_reading.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using Numbers = std::vector<double>;
constexpr int kSeen = 5;  // lane

/// A ball that presses a pad that is turned and pictured.
Scene seen_press(double radius) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {testing::link("plate", JointType::fixed, {0, 0, -0.005},
                           CuboidShape{{0.02, 0.02, 0.01}, {2, 2, 2}}, 1000),
             testing::link("ball", JointType::translational, {1.3e-3, -9e-4, 3e-3},
                           SphereShape{radius}, 1000)};
  TactileDescription t;
  t.name = "gel";
  t.body = "plate";
  t.array = {{0.0065, -0.0055, 0.005}, {-0.0065, 0.0055, 0.005}, {1, 0, 0}, {0, 1, 0}, 27, 23};
  t.coefficients = {40, 2, 0.6, 0};
  t.markers = MarkersDescription{300, 0, 0, {}};
  t.picture.emplace();
  t.picture->markers = {5, 4};
  t.picture->marker_radius = 3e-4;
  t.picture->rows = 28, t.picture->cols = 24;
  t.picture->mirror = true;
  t.picture->gel = std::make_shared<const Gel>(default_gel());
  s.sensors.push_back(t);
  return s;
}

double weighted(const Scene& scene, const Numbers& q, const Numbers& v, FieldForm form,
                const Numbers& weights) {
  const Model model(scene);
  Batch batch(model, 16, 0);
  batch.set_state(kSeen, q, v);
  PadReader reader(model);
  reader.move(batch, 0, 0);
  reader.find_touches(batch, 0, 0, 0);
  PictureReading<double> reading(model, 0);
  const auto touch = reader.arguments<double>(0, 0, kSeen);
  reading.set_touches(touch);
  if (reading.needs_field(form)) {
    const CompiledSensor& sensor = compiled(model).sensors[0];
    Numbers field(3 * std::size_t(sensor.points()));
    read_ideal(reader, sensor, touch, field);
    reading.set_field(form, field);
  }
  Numbers picture(weights.size());
  reading.read(form, std::span<double>(picture));
  double sum = 0;
  for (std::size_t k = 0; k < picture.size(); ++k) sum += weights[k] * picture[k];
  return sum;
}

TEST(PictureGradient, OfSpringsIsThatOfDifferences) {
  constexpr double kBallSize = 3e-3;
  const Numbers q{1e-4, -2e-4, -0.9e-3}, v{2e-3, -3e-3, 1e-3};
  const Scene scene = seen_press(kBallSize);
  const Model model(scene);
  testing::Random random(4);
  for (const FieldForm form : {FieldForm::height, FieldForm::rgb, FieldForm::rgb_marker}) {
    Numbers weights(numbers_of(model.sensors()[0], form));
    const double unit = form == FieldForm::height ? 1e4 : 1;
    for (double& w : weights) w = unit * random.uniform(0, 1);
    Batch batch(model, 16, 0);
    batch.set_state(kSeen, q, v);
    ReadoutPullback pullback(model);
    BlockCotangent c;
    for (auto* x : {&c.q, &c.v}) x->assign(3 * 16, 0.0);
    c.parameters.assign(std::size_t(compiled(model).view.rows.count) * 16, 0.0);
    pullback.place(batch, 0);
    pullback.clear();
    pullback.picture(kSeen, {0, form}, weights, c.parameters);
    pullback.finish(c);
    double largest = 0;
    for (std::size_t k = 0; k < 3; ++k) largest = std::max(largest, std::abs(c.q[16 * k + kSeen]));
    EXPECT_GT(largest, 1);
    const double step = 1e-9, faster = 1e-7;
    double largest_v_bar = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto along = [&](double dq, double dv) {
        Numbers q_there = q, v_there = v;
        q_there[k] += dq, v_there[k] += dv;
        return weighted(scene, q_there, v_there, form, weights);
      };
      EXPECT_NEAR(c.q[16 * k + kSeen], (along(step, 0) - along(-step, 0)) / (2 * step),
                  1e-4 * largest)
          << to_string(form) << " " << k;
      const double v_bar = c.v[16 * k + kSeen];
      EXPECT_NEAR(v_bar, (along(0, faster) - along(0, -faster)) / (2 * faster),
                  1e-4 * std::max(1.0, std::abs(v_bar)))
          << to_string(form) << " " << k;
      largest_v_bar = std::max(largest_v_bar, std::abs(v_bar));
    }
    EXPECT_EQ(largest_v_bar > 1, form == FieldForm::rgb_marker);
    const double by_radius =
        c.parameters[std::size_t(compiled(model).view.rows.solid(1)) * 16 + kSeen];
    const double expected = (weighted(seen_press(kBallSize + step), q, v, form, weights) -
                             weighted(seen_press(kBallSize - step), q, v, form, weights)) /
                            (2 * step);
    EXPECT_NEAR(by_radius, expected, 1e-4 * largest) << to_string(form);
  }
}

}  // namespace
}  // namespace tangere
