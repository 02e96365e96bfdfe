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
  t.coefficients = {40, 0, 0, 0};
  t.picture.emplace();
  t.picture->rows = 28, t.picture->cols = 24;
  t.picture->mirror = true;
  t.picture->gel = std::make_shared<const Gel>(default_gel());
  s.sensors.push_back(t);
  return s;
}

double weighted(const Scene& scene, const Numbers& q, FieldForm form, const Numbers& weights) {
  const Model model(scene);
  Batch batch(model, 16, 0);
  batch.set_state(kSeen, q, Numbers{0, 0, 0});
  PadReader reader(model);
  reader.move(batch, 0, 0);
  reader.find_touches(batch, 0, 0, 0);
  PictureReading<double> reading(model, 0);
  reading.set_touches(reader.arguments<double>(0, 0, kSeen));
  Numbers picture(weights.size());
  reading.read(form, std::span<double>(picture));
  double sum = 0;
  for (std::size_t k = 0; k < picture.size(); ++k) sum += weights[k] * picture[k];
  return sum;
}

TEST(PictureGradient, OfSpringsIsThatOfDifferences) {
  constexpr double kBallSize = 3e-3;
  const Numbers q{1e-4, -2e-4, -0.9e-3};
  const Scene scene = seen_press(kBallSize);
  const Model model(scene);
  testing::Random random(4);
  for (const FieldForm form : {FieldForm::height, FieldForm::rgb}) {
    Numbers weights(numbers_of(model.sensors()[0], form));
    const double unit = form == FieldForm::height ? 1e4 : 1;
    for (double& w : weights) w = unit * random.uniform(0, 1);
    Batch batch(model, 16, 0);
    batch.set_state(kSeen, q, Numbers{0, 0, 0});
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
    const double step = 1e-9;
    for (std::size_t k = 0; k < 3; ++k) {
      Numbers more = q, less = q;
      more[k] += step, less[k] -= step;
      const double expected =
          (weighted(scene, more, form, weights) - weighted(scene, less, form, weights)) /
          (2 * step);
      EXPECT_NEAR(c.q[16 * k + kSeen], expected, 1e-4 * largest) << to_string(form) << " " << k;
    }
    const double by_radius =
        c.parameters[std::size_t(compiled(model).view.rows.solid(1)) * 16 + kSeen];
    const double expected = (weighted(seen_press(kBallSize + step), q, form, weights) -
                             weighted(seen_press(kBallSize - step), q, form, weights)) /
                            (2 * step);
    EXPECT_NEAR(by_radius, expected, 1e-4 * largest) << to_string(form);
  }
}

}  // namespace
}  // namespace tangere
