// SPDX-License-Identifier: Apache-2.0
// The hull of points is closed and convex and has all of them inside, whatever the points.
#include "io/scene/convex_hull.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/scene/shapes.hpp"
#include "io/scene/surface_files.hpp"

namespace tangere {
namespace {

/// How far the outermost point is outside of any face, over the longest side.
double farthest_outside(const MeshShape& hull, const std::vector<double>& points) {
  double most = 0;
  for (const std::array<int, 3>& t : hull.triangles) {
    std::array<Vector3, 3> p{};
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t c = 0; c < 3; ++c) p[k][c] = hull.vertices[3 * std::size_t(t[k]) + c];
    Vector3 a{}, b{};
    for (std::size_t c = 0; c < 3; ++c) a[c] = p[1][c] - p[0][c], b[c] = p[2][c] - p[0][c];
    const Vector3 normal = cross(a, b);
    const double length = std::sqrt(dot(normal, normal));
    // A face is thinner than the rounding of its corners tilts it: the check would be of that.
    if (length < 1e-4) continue;
    for (std::size_t k = 0; k < points.size(); k += 3)
      most = std::max(most, dot(normal, {points[k] - p[0][0], points[k + 1] - p[0][1],
                                         points[k + 2] - p[0][2]}) /
                                length);
  }
  return most;
}

std::vector<double> grid(int n) {
  std::vector<double> points;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        for (const int x : {i, j, k}) points.push_back(double(x) / (n - 1));
  return points;
}

TEST(ConvexHull, OfAFilledCubeIsTheCube) {
  const std::vector<double> points = grid(9);
  const MeshShape hull = convex_hull(points);
  EXPECT_EQ(surface_fault(hull), "");
  EXPECT_NEAR(volume_of(hull), 1, 1e-12);
  EXPECT_NEAR(area_of(hull), 6, 1e-12);
  EXPECT_EQ(farthest_outside(hull, points), 0);
}

TEST(ConvexHull, OfPointsOnABallHasThemAll) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::vector<double> points;
  for (int k = 0; k < 2000; ++k) {
    Vector3 p = {normal(random), normal(random), normal(random)};
    const double length = std::sqrt(dot(p, p));
    for (const double x : p) points.push_back(x / length);
  }
  for (std::size_t k = 0; k < 3000; ++k) points.push_back(0.5 * points[k]);  // inside
  const MeshShape hull = convex_hull(points);
  EXPECT_EQ(surface_fault(hull), "");
  EXPECT_EQ(hull.vertices.size(), 6000);
  EXPECT_EQ(hull.triangles.size(), 2 * 2000 - 4);  // Euler
  EXPECT_LT(farthest_outside(hull, points), 1e-4);
  EXPECT_NEAR(volume_of(hull), 4 * M_PI / 3, 0.03);
}

TEST(ConvexHull, IsClosedWhateverTheRounding) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 200; ++trial) {
    // Points on few planes and lines, some of them the same up to rounding.
    std::uniform_int_distribution<int> cell(0, 2 + trial % 4);
    std::uniform_real_distribution<double> little(-1e-9, 1e-9);
    std::vector<double> points;
    for (int k = 0; k < 3 * 60; ++k) points.push_back(0.1 * cell(random) + little(random));
    const MeshShape hull = convex_hull(points);
    ASSERT_FALSE(hull.triangles.empty()) << trial;
    ASSERT_EQ(surface_fault(hull), "") << trial;
    ASSERT_LT(farthest_outside(hull, points), 1e-6) << trial;
  }
}

TEST(ConvexHull, HasNoFacesInAPlane) {
  EXPECT_TRUE(convex_hull({}).triangles.empty());
  EXPECT_TRUE(convex_hull({1, 2, 3, 1, 2, 3}).triangles.empty());
  EXPECT_TRUE(convex_hull({0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3}).triangles.empty());
  EXPECT_TRUE(convex_hull({0, 0, 1, 1, 0, 1, 0, 1, 1, 5, 7, 1}).triangles.empty());
}

}  // namespace
}  // namespace tangere
