// SPDX-License-Identifier: Apache-2.0
// The distances at nodes are the least of those to each triangle alone, bit by bit: no triangle is
// left out that is the nearest to some node.
#include "engine/model/node_distances.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/engine/meshes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere::testing {
namespace {

/// A grid of `count` nodes along each axis around a mesh, and beyond it.
GridNodes nodes_around(const MeshShape& mesh, int count) {
  GridNodes nodes{};
  double low[3], high[3];
  for (int k = 0; k < 3; ++k) low[k] = HUGE_VAL, high[k] = -HUGE_VAL;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    low[v % 3] = std::min(low[v % 3], mesh.vertices[v]);
    high[v % 3] = std::max(high[v % 3], mesh.vertices[v]);
  }
  for (int k = 0; k < 3; ++k) nodes.cell = std::max(nodes.cell, 1.2 * (high[k] - low[k]) / count);
  for (int k = 0; k < 3; ++k) {
    nodes.count[k] = count - k;  // no cube, and halves that differ
    nodes.origin[k] = 0.5 * (low[k] + high[k] - nodes.cell * (nodes.count[k] - 1));
  }
  return nodes;
}

void expect_least_of_all(const MeshShape& mesh, int count, double most_far) {
  const GridNodes nodes = nodes_around(mesh, count);
  std::vector<double> least(nodes.all(), HUGE_VAL);
  for (const std::array<int, 3>& t : mesh.triangles) {
    const std::vector<double> own = node_distances(mesh.vertices, {&t, 1}, nodes);
    for (std::size_t n = 0; n < own.size(); ++n) least[n] = std::min(least[n], own[n]);
  }
  const std::vector<double> d = node_distances(mesh.vertices, mesh.triangles, nodes);
  ASSERT_EQ(d.size(), least.size());
  int different = 0;
  for (std::size_t n = 0; n < d.size(); ++n) different += d[n] != least[n] ? 1 : 0;
  EXPECT_EQ(different, 0) << "of " << d.size();
  EXPECT_LT(*std::max_element(d.begin(), d.end()), most_far);
}

TEST(NodeDistances, AreTheLeastOfAllTriangles) {
  expect_least_of_all(ellipsoid_mesh(2, {0.02, 0.02, 0.02}), 15, 0.04);
  expect_least_of_all(ellipsoid_mesh(1, {0.03, 0.01, 0.002}), 20, 0.05);
  expect_least_of_all(torus_mesh(0.02, 0.006, 16, 8), 16, 0.05);
  expect_least_of_all(frame_mesh(0.02, 0.01, 0.006), 20, 0.05);
  expect_least_of_all(cuboid_mesh({0.012, 0.016, 0.02}), 20, 0.05);
}

TEST(NodeDistances, FarFromTheOriginTheyAreTheLeastToo) {
  MeshShape mesh = ellipsoid_mesh(2, {0.02, 0.02, 0.02});
  for (double& x : mesh.vertices) x += 3;
  expect_least_of_all(mesh, 16, 0.04);
}

/// The middle of all nodes is `offset` away from a plane of many triangles, whose gradient there is
/// hardly more than rounding.
TEST(NodeDistances, CloseToATriangleTheyAreTheLeastToo) {
  constexpr int kSide = 6;
  for (const double offset : {0.0, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8}) {
    MeshShape mesh;
    for (int i = 0; i <= kSide; ++i)
      for (int j = 0; j <= kSide; ++j)
        for (const double x : {0.007 * (i - 3), 0.007 * (j - 3) + 1e-3 * i, offset})
          mesh.vertices.push_back(x);
    for (int i = 0; i < kSide; ++i)
      for (int j = 0; j < kSide; ++j) {
        const int at = i * (kSide + 1) + j;
        mesh.triangles.push_back({at, at + kSide + 1, at + 1});
        mesh.triangles.push_back({at + kSide + 1, at + kSide + 2, at + 1});
      }
    // These two set the box around all.
    for (const double z : {-0.02, 0.02}) {
      const int at = static_cast<int>(mesh.vertices.size() / 3);
      for (const double x : {-0.024, -0.024, z, 0.027, 0.024, z, 0.0, 0.001, z})
        mesh.vertices.push_back(x);
      mesh.triangles.push_back({at, at + 1, at + 2});
    }
    expect_least_of_all(mesh, 17, 0.05);
  }
}

/// Triangles anywhere, long and thin ones, and some that are a line or a point.
TEST(NodeDistances, OfAnyTrianglesTheyAreTheLeast) {
  Random random(3);
  for (int n = 0; n < 20; ++n) {
    MeshShape mesh;
    for (int k = 0; k < 60; ++k) mesh.vertices.push_back(random.uniform(-0.02, 0.02));
    for (int k = 0; k < 40; ++k) {
      const auto corner = [&] { return int(random.uniform(0, 19.99)); };
      mesh.triangles.push_back({corner(), corner(), corner()});
    }
    expect_least_of_all(mesh, 13, 0.05);
  }
}

TEST(NodeDistances, ToOneTriangleTheyAreThoseInClosedForm) {
  const MeshShape mesh = {.vertices = {0, 0, 0, 3, 0, 0, 0, 4, 0}, .triangles = {{0, 1, 2}}};
  const GridNodes nodes = {{9, 9, 3}, {-4, -4, -1}, 1};
  const std::vector<double> d = node_distances(mesh.vertices, mesh.triangles, nodes);
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < 9; ++j)
      for (int k = 0; k < 3; ++k) {
        const double x = i - 4, y = j - 4, z = k - 1;
        const double left = std::max(-x, 0.0), below = std::max(-y, 0.0);
        const double along = std::clamp((3 * (3 - x) + 4 * y) / 25, 0.0, 1.0);
        const bool beyond = 4 * x + 3 * y > 12;
        // Beyond the longest side, along it; else beside the two others.
        const double flat = beyond ? std::hypot(x - 3 * (1 - along), y - 4 * along)
                            : x < 0 || y < 0
                                ? std::hypot(std::max(left, x - 3), std::max(below, y - 4))
                                : 0;
        EXPECT_NEAR(d[nodes.at(i, j, k)], std::hypot(flat, z), 1e-12) << x << " " << y << " " << z;
      }
}

}  // namespace
}  // namespace tangere::testing
