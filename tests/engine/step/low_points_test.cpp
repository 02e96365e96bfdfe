// SPDX-License-Identifier: Apache-2.0
// Tests that points which are left out above the ground change no bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "engine/model/compile.hpp"
#include "engine/model/contact_tiles.hpp"
#include "engine/step/group_step.hpp"
#include "kernels/step/low_points.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::kGroup;
using kernels::Vec3;

TEST(LowPoints, AreAllThatLieBelowTheGround) {
  testing::Random random(5);
  for (const int n : {33, 64, 200, 1000}) {
    std::vector<double> points(std::size_t(3 * n));
    for (double& x : points) x = random.normal();
    CompiledModel m;
    kernels::GroundContact ground{};
    ground.points = points.data(), ground.n_points = n;
    lay_out_tiles(m, ground);
    ASSERT_GT(ground.n_tiles, 0);
    std::vector<std::uint64_t> low(std::size_t(kernels::low_words(n)));
    int visited = 0, below = 0;
    for (int k = 0; k < 50; ++k) {
      Vec3<double> up{random.normal(), random.normal(), random.normal()};
      up = (1 / std::sqrt(dot(up, up))) * up;
      const double height = 4 * random.normal();
      std::vector<int> found;
      kernels::for_each_low_point<double>(ground, up, height, low.data(),
                                          [&](int i) { found.push_back(i); });
      EXPECT_TRUE(std::ranges::is_sorted(found));
      visited += int(found.size());
      for (int i = 0; i < n; ++i) {
        const double* p = ground.points + 3 * i;
        if (dot(up, Vec3<double>{p[0], p[1], p[2]}) + height >= 0) continue;
        ++below;
        EXPECT_TRUE(std::ranges::binary_search(found, i)) << "point " << i << " of " << n;
      }
    }
    EXPECT_GT(below, 0);
    EXPECT_LT(visited, 50 * n);
    EXPECT_LE(visited, below + 1);
  }
}

/// Eight mesh balls that drop and roll. `ks`: stiffness of shear springs. `tiles`: whether points
/// are left out.
std::vector<double> roll(const kernels::KernelTable& table, double ks, bool tiles, LaneBits lanes) {
  Scene scene = testing::rolling_ball(false, 8);
  MeshShape ball = testing::ellipsoid_mesh(2, {0.02, 0.02, 0.019});
  ball.resolution = 8;
  scene.links[1].body.shape = ball;
  scene.links[1].body.density = 500;
  scene.links.erase(scene.links.begin());
  scene.motors.clear(), scene.sensors.clear(), scene.pair_contacts.clear();
  scene.ground_contacts.front().coefficients = {500, 0.3, 0.8, ks > 0 ? 0.1 : 1, ks};
  const auto m = std::const_pointer_cast<CompiledModel>(compile(scene));
  EXPECT_EQ(m->grounds.front().n_points, 162);
  EXPECT_GT(m->grounds.front().n_tiles, 0);
  if (!tiles) m->grounds.front().n_tiles = 0;
  Workspace w(*m);
  SingleWorkspace alone(*m);
  const GroupStep step(*m, {Integrator::bdf1, 5e-3, 1e-9, 20});
  for (int l = 0; l < kGroup; ++l) {
    for (int i = 0; i < m->nq; ++i) w.q0[i][l] = m->initial_q[std::size_t(i)];
    w.v0[0][l] = 0.05 * l, w.v0[4][l] = 3, w.v0[2][l] = -0.04 * l;
  }
  for (int t = 0; t < 40; ++t) {
    NewtonReport report;
    step.advance(table, w, alone, lanes, kNoLane, report);
    for (int l = 0; l < kGroup; ++l)
      EXPECT_TRUE(!has(lanes, l) || !failed(report.status[std::size_t(l)])) << "lane " << l;
  }
  std::vector<double> states;
  for (int l = 0; l < kGroup; ++l)
    for (int i = 0; i < m->nq && has(lanes, l); ++i) states.push_back(w.q0[i][l]);
  return states;
}

TEST(LowPoints, ThatAreLeftOutChangeNoBits) {
  for (const kernels::KernelTable* table : kernels::available_kernels())
    for (const double ks : {0.0, 200.0}) {
      SCOPED_TRACE(table->name);
      const std::vector<double> all = roll(*table, ks, false, kAllLanes);
      EXPECT_EQ(roll(*table, ks, true, kAllLanes), all);
      const std::vector<double> one = roll(*table, ks, true, 1);
      EXPECT_TRUE(std::equal(one.begin(), one.end(), all.begin()));
    }
}

}  // namespace
}  // namespace tangere
