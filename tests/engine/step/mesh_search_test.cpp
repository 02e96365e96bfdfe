// SPDX-License-Identifier: Apache-2.0
// Tests the search for points near a mesh: what spheres of tiles and of eight points leave out is
// out of reach. The list is that of all points tested one by one, also of those at the edge of
// reach.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "engine/model/compile.hpp"
#include "engine/model/mesh_grid.hpp"
#include "kernels/contact/distance.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::KernelTable;
using kernels::PairContact;
using kernels::Vec3;
using testing::Random;

/// The contact of a pad of 2 168 points with a mesh of 24 cells.
struct PadOnMesh {
  std::shared_ptr<const CompiledModel> model;
  const PairContact* pair = nullptr;

  explicit PadOnMesh(MeshShape mesh) {
    Scene scene = testing::rolling_ball(false, 8);
    mesh.resolution = 24;
    scene.links[1].body.shape = mesh;
    model = compile(scene);
    for (const PairContact& p : model->pairs)
      if (p.grid != nullptr) pair = &p;
  }
};

struct Pose {
  double numbers[12];
  kernels::Frame<double> frame;
};
/// A mesh that reaches the pad's points somewhere.
Pose drawn_pose(Random& random) {
  Pose pose;
  pose.frame.R = random.rotation();
  pose.frame.p = {random.uniform(-0.03, 0.03), random.uniform(-0.03, 0.03),
                  random.uniform(-0.025, 0.025)};
  for (int i = 0; i < 9; ++i) pose.numbers[i] = pose.frame.R.m[i / 3][i % 3];
  pose.numbers[9] = pose.frame.p.x, pose.numbers[10] = pose.frame.p.y;
  pose.numbers[11] = pose.frame.p.z;
  return pose;
}

/// Returns which points of a pair the search lists.
std::vector<int> listed(const KernelTable& table, const PairContact& pair, const Pose& pose,
                        double scale, double margin) {
  const int stride = pair.n_points + 16;
  std::vector<double> points(std::size_t(3 * stride));
  std::vector<int> index(points.size() / 3);
  const int count = table.find_candidates(
      {&pair, {scale, 0, 0}, pose.numbers, margin, points.data(), stride, {0, 0, 0}, index.data()});
  index.resize(std::size_t(count));
  for (int k = 0; k < count; ++k)
    for (int c = 0; c < 3; ++c)
      EXPECT_EQ(points[std::size_t(c * stride + k)], pair.points[3 * index[std::size_t(k)] + c]);
  return index;
}

/// The distances of a pair's points to the mesh.
std::vector<double> point_distances(const PairContact& pair, const Pose& pose, double scale) {
  const auto mesh = kernels::MeshDistance<double>::of({scale, 0, 0}, pair.grid);
  std::vector<double> d;
  for (int k = 0; k < pair.n_points; ++k) {
    const double* p = pair.points + 3 * k;
    const Vec3<double> arm = Vec3<double>{p[0], p[1], p[2]} - pose.frame.p;
    d.push_back(mesh.evaluate(transposed_times(pose.frame.R, arm)).d);
  }
  return d;
}

/// Searches at drawn poses, scales and margins. Half of the margins are by little more than the
/// distance of some point.
void expect_nothing_is_left_out(const MeshShape& mesh) {
  const PadOnMesh pad(mesh);
  ASSERT_NE(pad.pair, nullptr);
  ASSERT_NE(pad.pair->eight_bounds, nullptr);
  PairContact tiles = *pad.pair, all = *pad.pair;
  tiles.eight_bounds = all.eight_bounds = nullptr;
  AlignedVector<double> whole(std::size_t((all.n_tiles + 7) / 8 * 32), 0.0);
  for (std::size_t k = 0; k < whole.size(); ++k)
    if (k / 8 % 4 == 3) whole[k] = 1;  // radii of a metre
  all.tile_bounds = whole.data();
  Random random(11);
  int found = 0;
  for (int n = 0; n < 40; ++n) {
    const Pose pose = drawn_pose(random);
    const double scale = n % 3 == 0 ? 0.8 : 1.0;
    const std::vector<double> d = point_distances(*pad.pair, pose, scale);
    double margin = random.uniform(1e-5, 1e-3);
    if (n % 2 == 0) {
      const double near = d[std::size_t(random.integer(0, pad.pair->n_points - 1))];
      if (near > 0 && near < 1.5e-3) margin = near * (1 + 1e-9);
      for (const double x : d)
        if (n % 4 == 0 && x > 2e-4 && x < 1e-3) margin = x * (1 + 1e-9);
    }
    for (const KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(std::string(table->name) + ", pose " + std::to_string(n));
      const std::vector<int> got = listed(*table, *pad.pair, pose, scale, margin);
      EXPECT_EQ(got, listed(*table, tiles, pose, scale, margin));
      EXPECT_EQ(got, listed(*table, all, pose, scale, margin));
      std::vector<bool> in(d.size());
      for (const int k : got) in[std::size_t(k)] = true;
      for (std::size_t k = 0; k < d.size(); ++k)
        EXPECT_TRUE(in[k] || d[k] >= margin) << k << ": " << d[k] << " < " << margin;
      found += static_cast<int>(got.size());
    }
  }
  EXPECT_GT(found, 1000);
}

TEST(MeshSearch, NothingWithinReachOfABallIsLeftOut) {
  expect_nothing_is_left_out(testing::ellipsoid_mesh(2, {0.02, 0.015, 0.01}));
}
TEST(MeshSearch, NothingWithinReachOfARingIsLeftOut) {
  expect_nothing_is_left_out(testing::torus_mesh(0.016, 0.006, 24, 12));
}
TEST(MeshSearch, NothingWithinReachOfAFrameIsLeftOut) {
  expect_nothing_is_left_out(testing::frame_mesh(0.02, 0.01, 0.006));
}

TEST(MeshSearch, APoseThatIsNotFiniteListsNothing) {
  const PadOnMesh pad(testing::ellipsoid_mesh(2, {0.02, 0.015, 0.01}));
  for (const double wrong : {std::nan(""), HUGE_VAL, -HUGE_VAL})
    for (const int number : {9, 11}) {
      Random random(5);
      Pose pose = drawn_pose(random);
      pose.numbers[number] = wrong;
      for (const KernelTable* table : kernels::available_kernels())
        EXPECT_TRUE(listed(*table, *pad.pair, pose, 1, 1e-3).empty()) << table->name;
    }
}

TEST(MeshSearch, TheBallsOfEightHoldTheirPoints) {
  const PadOnMesh pad(testing::cuboid_mesh({0.01, 0.01, 0.01}));
  const PairContact& pair = *pad.pair;
  for (int k = 0; k < pair.n_points; ++k) {
    const int eight = k / 8;
    const double *ball = pair.eight_bounds + eight / 8 * 32 + eight % 8, *p = pair.points + 3 * k;
    const Vec3<double> arm = {p[0] - ball[0], p[1] - ball[8], p[2] - ball[16]};
    EXPECT_LE(std::sqrt(dot(arm, arm)), ball[24]) << k;
    EXPECT_LT(ball[24], 0.03);
  }
}

}  // namespace
}  // namespace tangere
