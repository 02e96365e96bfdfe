// SPDX-License-Identifier: Apache-2.0
// Tests the wrenches of contacts against what they do to the equations of motion, and the share in
// which sets of them differ.
#include "engine/step/contact_forces.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compile.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using kernels::Row;
using kernels::Vec3;

/// A box that is 1 mm deep in the ground with its lower corners, and slides and turns.
Scene box_in_ground(bool touches) {
  Scene scene;
  scene.ground = GroundDescription{};
  scene.links = {testing::link("box", JointType::free, {0, 0, 0.049},
                               CuboidShape{{0.1, 0.1, 0.1}, {2, 2, 2}}, 500)};
  if (touches)
    scene.ground_contacts.push_back({"box", {1e3, 5, 0.5, 10}, ContactLaw::clamped, 0, {}});
  return scene;
}

/// Without contacts the residual is what it is with them, plus Sᵀ w.
TEST(ContactWrenches, AreWhatContactsAddToTheResidual) {
  const auto with = compile(box_in_ground(true)), without = compile(box_in_ground(false));
  std::vector<double> g[2], wrench;
  testing::StageBuffers<double> touching(*with), free(*without);
  for (testing::StageBuffers<double>* b : {&touching, &free}) {
    b->centre = with->initial_q;
    b->x = {1e-3, -2e-3, 5e-4, 0.01, -0.02, 0.03};
    b->r = {3e-4, 2e-4, -1e-4, 2e-3, 1e-3, -3e-3};
    b->residual(300, 200);
  }
  wrench = touching.wrenches();
  ASSERT_EQ(wrench.size(), 6U);
  const Vec3<double> turn = {0.01, -0.02, 0.03};
  const auto R = rotation_exp(turn, rotation_series(turn));
  const Vec3<double> force = R * Vec3<double>{wrench[3], wrench[4], wrench[5]};
  EXPECT_GT(force.z, 1) << "the ground carries the box";
  EXPECT_NEAR(free.g[0] - touching.g[0], force.x, 1e-12 * force.z);
  EXPECT_NEAR(free.g[1] - touching.g[1], force.y, 1e-12 * force.z);
  EXPECT_NEAR(free.g[2] - touching.g[2], force.z, 1e-12 * force.z);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(free.g[3 + i] - touching.g[3 + i], wrench[i], 1e-12 * force.z);
}

/// Rows of one lane with a force for each contact, along z [N].
std::vector<Row<1>> forces(std::initializer_list<double> z) {
  std::vector<Row<1>> rows(6 * z.size());
  std::size_t k = 0;
  for (const double force : z) rows[6 * k++ + 5][0] = force;
  return rows;
}

/// The ball under a pad: what the pad feels counts by itself, what the ground carries counts beside
/// a twentieth of the weight of both bodies.
TEST(ContactForces, AreGroupedByWhatIsFelt) {
  Scene scene = testing::rolling_ball(false, 4);
  for (const bool sensor : {true, false}) {
    SCOPED_TRACE(sensor);
    if (!sensor) scene.sensors.clear();
    const auto model = compile(scene);
    ASSERT_EQ(model->link_pairs.size() + model->grounded.size(), 2U);
    const ContactForces of(*model);
    double weight = 0;
    for (const kernels::Link& link : model->links) weight += 9.8 * link.mass;
    const auto change = [&](std::initializer_list<double> start, std::initializer_list<double> end,
                            std::initializer_list<double> a, std::initializer_list<double> b) {
      return of.change<1>(forces(start).data(), forces(end).data(), forces(a).data(),
                          forces(b).data(), 0);
    };
    // Pairs come first. These forces go through the middle of the points.
    const double floor = 0.01 * weight;
    EXPECT_EQ(change({1, 0}, {1, 0}, {1, 0}, {1, 0}), 0);
    const double one = change({1, 0}, {2, 0}, {2.3, 0}, {2, 0});
    const double larger = change({4, 0}, {2, 0}, {2.3, 0}, {2, 0});
    EXPECT_NEAR(one * (2 + floor), larger * (4 + floor), 1e-12) << "relative to the larger of both";
    EXPECT_NEAR(change({1, 0}, {2, 0}, {2.3, 0}, {2.4, 0}),
                change({1, 0}, {2, 0}, {2.5, 0}, {2, 0}), 1e-12)
        << "roots of sums of squares";
    const double of_ground = change({0, 1}, {0, 1}, {0, 1.2}, {0, 1});
    if (sensor) {
      EXPECT_NEAR(of_ground, 0.2 / (1 + 0.05 * weight), 1e-12);
      EXPECT_EQ(change({1, 1}, {1, 1}, {1, 1.2}, {1, 1}), of_ground) << "groups are apart";
    } else {
      EXPECT_NEAR(of_ground, 0.2 / (1 + floor), 1e-12);
      EXPECT_LT(change({1, 1}, {1, 1}, {1, 1.2}, {1, 1}), 0.9 * of_ground) << "one group";
    }
    EXPECT_EQ(of.touching<1>(forces({0, 0}).data()), 0U);
    EXPECT_EQ(of.touching<1>(forces({0, 0.1}).data()), 1U);
  }
}

/// A torque counts by the force that it is at the rim.
TEST(ContactForces, CountTorquesByTheirForceAtTheRim) {
  const auto model = compile(testing::rolling_ball(false, 4));
  const ContactForces of(*model);
  const kernels::PairContact& pair = model->pairs[0];
  auto still = forces({1, 0}), turned = still;
  turned[0][0] = 0.5 * pair.extent;
  const double change = of.change<1>(still.data(), still.data(), turned.data(), still.data(), 0);
  auto pushed = still;
  const Vec3<double> aside = cross(pair.middle, {0.5, 0, 0});
  pushed[0][0] += aside.x, pushed[1][0] += aside.y, pushed[2][0] += aside.z, pushed[3][0] += 0.5;
  EXPECT_NEAR(of.change<1>(still.data(), still.data(), pushed.data(), still.data(), 0), change,
              1e-12);
}

}  // namespace
}  // namespace tangere
