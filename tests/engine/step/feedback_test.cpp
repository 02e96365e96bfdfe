// SPDX-License-Identifier: Apache-2.0
// Tests feedback="true" of a sensor: the sum of its field is the force in the dynamics.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/feedback_scene.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using testing::kTable;
using testing::with;

Scene feedback_scene(const std::string& text) { return parse_scene(text, "s.xml").scene; }

/// Force of the field on the sensor's body in world axes [N]; the pad's axes are those of the
/// world.
std::array<double, 3> sum_of(Readout& readout, const Batch& batch, std::vector<double>& field) {
  readout.tactile(batch, 0, 0, field);
  std::array<double, 3> sum{};
  for (std::size_t k = 0; k < field.size(); ++k) sum[k % 3] += (k % 3 == 2 ? -1 : 1) * field[k];
  return sum;
}

/// Checks in each of 100 steps that the ball's momentum changes by gravity and the field alone.
void expect_balance(const std::string& text) {
  const Model model(feedback_scene(text));
  Batch batch(model, 1, 0);
  Stepper stepper(model);
  Readout readout(model);
  std::vector<double> field(3 * model.sensors()[0].points), pose(7 * 2), twist(6 * 2);
  const double m = 4 * M_PI / 3 * 8e-6 * 3000, h = 1e-3;
  std::array<double, 3> before = {0.05, -0.02, 0};
  double largest = 0, shear = 0;
  for (int step = 0; step < 100; ++step) {
    stepper.step(batch, {});
    ASSERT_EQ(int(batch.status(0)), 0);
    const std::array<double, 3> on_pad = sum_of(readout, batch, field);
    readout.bodies(batch, 0, pose, twist);
    const double gravity[3] = {0, 0, -10};
    for (std::size_t k = 0; k < 3; ++k) {
      const double now = twist[6 + 3 + k];
      EXPECT_NEAR(m * ((now - before[k]) / h - gravity[k]), -on_pad[k], 1e-8) << step << ' ' << k;
      before[k] = now;
    }
    largest = std::max(largest, -on_pad[2]);
    shear = std::max(shear, std::hypot(on_pad[0], on_pad[1]));
  }
  EXPECT_GT(largest, 1);
  EXPECT_GT(shear, 0.01);
}

TEST(Feedback, TheFieldIsTheForceInTheDynamics) { expect_balance(kTable); }

TEST(Feedback, WithoutItTheBallFallsThrough) {
  const Model model(feedback_scene(with(" feedback=\"true\"", "", kTable)));
  EXPECT_TRUE(model.contacts().empty());
}

TEST(Feedback, TouchesEveryBodyThatMovesAgainstTheSensor) {
  const Scene scene = feedback_scene(kTable);
  ASSERT_EQ(scene.pair_contacts.size(), 1U);
  EXPECT_EQ(scene.pair_contacts[0].primitive_body, "ball");
  const Model model(scene);
  EXPECT_EQ(model.contacts()[0].first, "tactile skin");
  EXPECT_EQ(model.contacts()[0].points, 441);
}

}  // namespace
}  // namespace tangere
