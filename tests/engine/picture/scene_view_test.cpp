// SPDX-License-Identifier: Apache-2.0
// Tests what a camera sees of solids and meshes: depths against the first root of a shape's
// distance along each ray, in double precision; silhouettes to a pixel; meshes against the same
// solids.
#include "engine/picture/scene_view.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "engine/scene/shapes.hpp"

namespace tangere {
namespace {

constexpr int kPixels = 64;
constexpr double kFov = 45, kSide = 0.03;  // [degrees], [m] of the shapes
constexpr double kShort = 1e-6;            // [m] of depths that must agree

struct Posed {
  Shape shape;
  ViewSolid solid;
};

ViewGrid square_grid() { return {kPixels, kPixels, kFov, 10}; }

std::array<Vector3, 3> random_axes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3{normal(random), normal(random), normal(random)}; };
  const Vector3 x = unit(any()), z = unit(cross(x, any()));
  return {x, cross(z, x), z};
}

/// Shapes about 0.3 m before the camera, off its middle.
std::vector<Posed> posed_shapes(int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> off(-0.04, 0.04);
  std::vector<Posed> all{
      {SphereShape{kSide}, {.kind = SolidKind::ball, .size = {kSide, kSide, kSide}}},
      {EllipsoidShape{{0.06, 0.03, 0.09}},
       {.kind = SolidKind::ellipsoid, .size = {0.03, 0.015, 0.045}}},
      {CuboidShape{{0.06, 0.04, 0.03}}, {.kind = SolidKind::cuboid, .size = {0.03, 0.02, 0.015}}},
      {CylinderShape{0.06, 0.02}, {.kind = SolidKind::cylinder, .size = {0.02, 0.03, 0}}},
      {CapsuleShape{0.05, 0.015}, {.kind = SolidKind::capsule, .size = {0.015, 0.025, 0}}}};
  for (Posed& one : all) {
    one.solid.axes = random_axes(random);
    one.solid.origin = {off(random), off(random), 0.3 + off(random)};
    one.solid.number = 7;
    one.solid.colour = {1, 0.5, 0};
  }
  return all;
}

Vector3 ray_of(int row, int col) {
  const double focal = square_grid().focal();
  return {(col + 0.5 - 0.5 * kPixels) / focal, (row + 0.5 - 0.5 * kPixels) / focal, 1};
}

SurfaceDistance distance_at(const Posed& of, const Vector3& ray, double t) {
  const Vector3 off = t * ray - of.solid.origin;
  return *distance_from(of.shape, {dot(off, of.solid.axes[0]), dot(off, of.solid.axes[1]),
                                   dot(off, of.solid.axes[2])});
}

/// The first depth at which a ray is on the surface; 0: it misses. `slope`: of the surface's normal
/// against the ray.
double first_root(const Posed& of, const Vector3& ray, double& slope) {
  constexpr double kReach = 0.08, kStep = 1e-3;
  const double from = of.solid.origin[2] - kReach, to = of.solid.origin[2] + kReach;
  for (double t = from, far = 0; t < to; t += std::max(kStep, 0.5 * far)) {
    far = distance_at(of, ray, t + kStep).distance;
    if (far >= 0) continue;
    double outside = t, inside = t + kStep;
    while (inside - outside > 1e-12) {
      const double middle = 0.5 * (outside + inside);
      (distance_at(of, ray, middle).distance < 0 ? inside : outside) = middle;
    }
    const Vector3 n = distance_at(of, ray, inside).normal;
    Vector3 world{};
    for (std::size_t k = 0; k < 3; ++k) world = world + n[k] * of.solid.axes[k];
    slope = -dot(world, unit(ray));
    return inside;
  }
  return 0;
}

/// How many pixels differ from closed forms, and by how much depths do.
struct Agreement {
  int hits = 0, compared = 0, beyond_edge = 0;
  double worst = 0;  // [m]
};

Agreement compare(const Posed& of, const SceneView& view) {
  std::vector<double> roots(kPixels * kPixels), slopes(roots.size());
  Agreement found;
  for (int i = 0; i < kPixels; ++i)
    for (int j = 0; j < kPixels; ++j) {
      const std::size_t k = std::size_t(i * kPixels + j);
      roots[k] = first_root(of, ray_of(i, j), slopes[k]);
    }
  for (int i = 1; i + 1 < kPixels; ++i)
    for (int j = 1; j + 1 < kPixels; ++j) {
      const std::size_t k = std::size_t(i * kPixels + j);
      const bool hit = view.numbers()[k] == of.solid.number;
      found.hits += hit ? 1 : 0;
      int around = 0;  // pixels of nine that are inside
      for (int a = -1; a <= 1; ++a)
        for (int b = -1; b <= 1; ++b) around += roots[k + std::size_t(a * kPixels + b)] > 0 ? 1 : 0;
      if (hit != (roots[k] > 0) && (around == 0 || around == 9)) ++found.beyond_edge;
      constexpr double kGrazing = 0.2;
      if (!hit || roots[k] == 0 || slopes[k] < kGrazing) continue;
      ++found.compared;
      found.worst = std::max(found.worst, std::abs(double(view.depth()[k]) - roots[k]));
    }
  return found;
}

TEST(SceneView, SolidsHaveTheDepthOfTheirFirstRoot) {
  for (int seed = 0; seed < 2; ++seed)
    for (const Posed& one : posed_shapes(seed)) {
      SceneView view(square_grid());
      view.begin({0, 0, -1}, 0.3);
      view.add(one.solid);
      const Agreement found = compare(one, view);
      EXPECT_GT(found.compared, 60) << shape_name(one.shape);
      EXPECT_LT(found.worst, kShort) << shape_name(one.shape) << ' ' << seed;
      EXPECT_EQ(found.beyond_edge, 0) << shape_name(one.shape) << ' ' << seed;
    }
}

TEST(SceneView, AnIdIsThereWhereTheDepthIs) {
  SceneView view(square_grid());
  view.begin({0, 0, -1}, 0.3);
  for (int pass = 0; pass < 2; ++pass) {
    int hits = 0;
    for (std::size_t k = 0; k < view.grid().pixels(); ++k) {
      ASSERT_EQ(view.numbers()[k] == kNoSolid, view.depth()[k] == 10.0F) << k;
      hits += view.numbers()[k] == 7 ? 1 : 0;
    }
    if (pass == 0) {
      EXPECT_EQ(hits, 0);
      view.add(posed_shapes(1)[2].solid);
    } else {
      EXPECT_GT(hits, 60);
    }
  }
}

/// A half-space whose surface is `height` below the camera, which points along it.
ViewSolid floor_below(double height) {
  ViewSolid solid;
  solid.kind = SolidKind::half_space;
  solid.axes = {Vector3{1, 0, 0}, Vector3{0, 0, 1}, Vector3{0, -1, 0}};
  solid.origin = {0, height, 0};
  solid.number = 3;
  solid.colour = {0.5, 0.5, 0.5};
  return solid;
}

TEST(SceneView, APlaneHasTheDepthOfItsRays) {
  SceneView view(square_grid());
  view.begin({0, -1, 0}, 0.3);
  view.add(floor_below(0.2));
  for (int i = 0; i < kPixels; ++i)
    for (int j = 0; j < kPixels; ++j) {
      const double down = ray_of(i, j)[1], t = 0.2 / down;
      const std::size_t k = std::size_t(i * kPixels + j);
      const bool seen = down > 0 && t < 10;
      ASSERT_EQ(view.numbers()[k], seen ? 3 : kNoSolid) << i;
      if (seen) {
        ASSERT_NEAR(view.depth()[k], t, kShort * std::max(1.0, t)) << i << ' ' << j;
      }
    }
  view.begin({0, -1, 0}, 0.3);
  view.add(floor_below(-0.2));  // the camera is inside
  EXPECT_THAT(view.numbers(), ::testing::Each(kNoSolid));
}

TEST(SceneView, TheGroundHasSquaresThatFadeFarAway) {
  SceneView view({256, 256, kFov, 100});
  ViewSolid floor = floor_below(0.2);
  floor.square = 0.05;
  view.begin({0, -1, 0}, 0.3);
  view.add(floor);
  const auto tones_of = [&](int row) {
    std::map<std::uint32_t, int> tones;
    for (int j = 0; j < 256; ++j) ++tones[view.colours()[std::size_t(row * 256 + j)]];
    return tones;
  };
  EXPECT_EQ(tones_of(255).size(), 2U);
  EXPECT_EQ(tones_of(130).size(), 1U);
  // The squares of the lowest row: 0.05 m by what a row shows.
  const double depth = view.depth()[255 * 256], focal = view.grid().focal();
  int changes = 0;
  for (int j = 1; j < 256; ++j)
    changes +=
        view.colours()[std::size_t(255 * 256 + j)] != view.colours()[std::size_t(255 * 256 + j - 1)]
            ? 1
            : 0;
  EXPECT_NEAR(changes, 256 * depth / focal / 0.05, 1.01);
}

/// A cuboid or a ball as triangles, anticlockwise from outside.
struct Triangles {
  std::vector<double> vertices;
  std::vector<std::array<int, 3>> list;
};
Triangles box_of(const Vector3& half) {
  Triangles box;
  for (int k = 0; k < 8; ++k)
    for (int i = 0; i < 3; ++i)
      box.vertices.push_back((k >> i & 1 ? 1 : -1) * half[std::size_t(i)]);
  for (const std::array<int, 4>& face : {std::array{0, 4, 6, 2},
                                         {1, 3, 7, 5},
                                         {0, 1, 5, 4},
                                         {2, 6, 7, 3},
                                         {0, 2, 3, 1},
                                         {4, 5, 7, 6}}) {
    box.list.push_back({face[0], face[1], face[2]});
    box.list.push_back({face[0], face[2], face[3]});
  }
  return box;
}
Triangles ball_of(double radius, int rings) {
  Triangles ball;
  const int around = 2 * rings;
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j < around; ++j) {
      const double lift = M_PI * i / rings, turn = 2 * M_PI * j / around;
      for (const double x :
           {std::sin(lift) * std::cos(turn), std::sin(lift) * std::sin(turn), std::cos(lift)})
        ball.vertices.push_back(radius * x);
    }
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < around; ++j) {
      const int a = i * around + j, b = i * around + (j + 1) % around;
      if (i > 0) ball.list.push_back({a, a + around, b});
      if (i < rings - 1) ball.list.push_back({b, a + around, b + around});
    }
  return ball;
}

TEST(SceneView, AMeshOfACuboidIsTheCuboid) {
  for (int seed = 0; seed < 4; ++seed) {
    const Posed one = posed_shapes(seed)[2];
    const Triangles box = box_of(one.solid.size);
    SceneView solid(square_grid()), mesh(square_grid());
    for (SceneView* view : {&solid, &mesh}) view->begin(unit(Vector3{0.3, -0.5, -0.6}), 0.3);
    solid.add(one.solid);
    mesh.add(ViewMesh{box.vertices, box.list, 1}, one.solid);
    const Agreement found = compare(one, mesh);
    EXPECT_GT(found.compared, 60);
    EXPECT_LT(found.worst, kShort) << seed;
    EXPECT_EQ(found.beyond_edge, 0) << seed;
    int other_number = 0, other_colour = 0;
    for (std::size_t k = 0; k < mesh.grid().pixels(); ++k) {
      other_number += mesh.numbers()[k] != solid.numbers()[k] ? 1 : 0;
      for (int c = 0; c < 24; c += 8) {
        const int a = int(mesh.colours()[k] >> c & 255U), b = int(solid.colours()[k] >> c & 255U);
        other_colour += std::abs(a - b) > 1 ? 1 : 0;
      }
    }
    EXPECT_LE(other_number, 4) << seed;   // centres within 1/512 of a pixel of an edge
    EXPECT_LE(other_colour, 24) << seed;  // on edges of the cuboid, too
  }
}

Posed glossy(Posed one) {
  one.solid.colour = {0.6, 0.3, 0.1};
  one.solid.specular = 0.8, one.solid.exponent = 20, one.solid.emission = 0.1;
  return one;
}

/// The normal of a solid at a pixel, in the camera's axes.
Vector3 normal_at(const Posed& of, const Vector3& ray, double depth) {
  const Vector3 n = distance_at(of, ray, depth).normal;
  Vector3 turned{};
  for (std::size_t k = 0; k < 3; ++k) turned = turned + n[k] * of.solid.axes[k];
  return turned;
}

/// Levels by the law that scene_view.hpp states, with the normal of the shape's distance.
std::array<double, 3> levels_by_law(const ViewSolid& of, const Vector3& n, const Vector3& ray,
                                    const Vector3& light, double ambient, double brightness) {
  const double direct = brightness * (1 - ambient), cosine = dot(n, light);
  const double high =
      cosine > 0 ? std::pow(std::max(0.0, dot(n, unit(light - unit(ray)))), of.exponent) : 0;
  std::array<double, 3> levels{};
  for (std::size_t c = 0; c < 3; ++c)
    levels[c] =
        std::min(255.0, 255 * (of.colour[c] * (brightness * ambient +
                                               direct * std::max(0.0, cosine) + of.emission) +
                               of.specular * direct * high));
  return levels;
}

TEST(SceneView, HighlightsAreThoseOfTheLaw) {
  const Vector3 light = unit(Vector3{-0.2, -0.3, -0.9});
  constexpr double kAmbient = 0.3, kBrightness = 1.2;
  int bright = 0;
  for (int seed = 0; seed < 3; ++seed)
    for (const Posed& given : posed_shapes(seed)) {
      const Posed one = glossy(given);
      SceneView view(square_grid());
      view.begin(light, kAmbient, kBrightness);
      view.add(one.solid);
      int compared = 0, other = 0;
      for (int i = 0; i < kPixels; ++i)
        for (int j = 0; j < kPixels; ++j) {
          const std::size_t k = std::size_t(i * kPixels + j);
          if (view.numbers()[k] != 7) continue;
          const Vector3 ray = ray_of(i, j), n = normal_at(one, ray, view.depth()[k]);
          if (-dot(n, unit(ray)) < 0.1) continue;  // grazing
          const auto levels = levels_by_law(one.solid, n, ray, light, kAmbient, kBrightness);
          ++compared;
          bool same = true;
          for (std::size_t c = 0; c < 3; ++c) {
            const double level = double(view.colours()[k] >> (8 * c) & 255U);
            same = same && std::abs(level - levels[c]) < 1;
          }
          other += same ? 0 : 1;
          bright += levels[2] > 100 ? 1 : 0;  // of 0.1: a highlight
        }
      EXPECT_GT(compared, 60) << shape_name(one.shape);
      EXPECT_LE(other, compared / 50) << shape_name(one.shape) << ' ' << seed;  // on edges
    }
  EXPECT_GT(bright, 100);
  SceneView view(square_grid());
  ViewSolid floor = floor_below(0.2);
  floor.specular = 0.9, floor.exponent = 5;
  const Vector3 behind = unit(Vector3{0.1, -0.5, 0.8});
  view.begin(behind, kAmbient);
  view.add(floor);
  for (int i = 40; i < kPixels; ++i) {
    const auto levels = levels_by_law(floor, {0, -1, 0}, ray_of(i, 20), behind, kAmbient, 1);
    ASSERT_NEAR(view.colours()[std::size_t(i * kPixels + 20)] & 255U, levels[0], 1) << i;
  }
}

TEST(SceneView, AHighlightOfAMeshIsThatOfItsFaces) {
  for (int seed = 0; seed < 3; ++seed) {
    const Posed one = glossy(posed_shapes(seed)[2]);
    const Triangles box = box_of(one.solid.size);
    SceneView solid(square_grid()), mesh(square_grid());
    for (SceneView* view : {&solid, &mesh}) view->begin(unit(Vector3{-0.2, -0.3, -0.9}), 0.3);
    solid.add(one.solid);
    mesh.add(ViewMesh{box.vertices, box.list, 1}, one.solid);
    int other = 0;
    for (std::size_t k = 0; k < mesh.grid().pixels(); ++k)
      for (int c = 0; c < 24; c += 8) {
        const int a = int(mesh.colours()[k] >> c & 255U), b = int(solid.colours()[k] >> c & 255U);
        other += std::abs(a - b) > 1 ? 1 : 0;
      }
    EXPECT_LE(other, 24) << seed;
  }
}

/// What has no highlight has the bytes of a highlight that is too weak to be seen, and every
/// instruction set has the same bytes, whose sum stands here.
TEST(SceneView, MaterialsHaveFixedBytesAndNoneIsNone) {
  std::uint64_t sum = 14695981039346656037ULL;
  for (Posed one : posed_shapes(1)) {
    SceneView plain(square_grid()), weak(square_grid()), shiny(square_grid());
    for (SceneView* view : {&plain, &weak, &shiny}) view->begin({0, 0, -1}, 0.3);
    plain.add(one.solid);
    one.solid.specular = 1e-30;
    weak.add(one.solid);
    EXPECT_TRUE(std::ranges::equal(plain.colours(), weak.colours())) << shape_name(one.shape);
    shiny.add(glossy(one).solid);
    EXPECT_FALSE(std::ranges::equal(plain.colours(), shiny.colours())) << shape_name(one.shape);
    for (const std::uint32_t colour : shiny.colours()) sum = (sum ^ colour) * 1099511628211ULL;
  }
  EXPECT_EQ(sum, 8484435728943278324ULL);
}

/// Light above 1 ends at white, in solids and meshes.
TEST(SceneView, BrightnessEndsAtWhite) {
  const Posed one = posed_shapes(1)[2];
  const Triangles box = box_of(one.solid.size);
  SceneView solid(square_grid()), mesh(square_grid());
  for (SceneView* view : {&solid, &mesh}) view->begin({0, 0, -1}, 0.3, 50);
  solid.add(one.solid);
  mesh.add(ViewMesh{box.vertices, box.list, 1}, one.solid);
  const auto middle = static_cast<std::size_t>(std::ranges::find(mesh.numbers(), one.solid.number) -
                                               mesh.numbers().begin());
  EXPECT_EQ(mesh.colours()[middle], 255U | (255U << 8));  // red 1, green 0.5, no blue
  EXPECT_EQ(solid.colours()[middle], mesh.colours()[middle]);
}

TEST(SceneView, AClosedMeshHasNoGaps) {
  ViewSolid at = posed_shapes(0)[0].solid;
  const double radius = 0.05;
  const Triangles ball = ball_of(radius, 48);
  SceneView view({256, 256, kFov, 10}), inner({256, 256, kFov, 10});
  for (SceneView* one : {&view, &inner}) one->begin({0, 0, -1}, 0.3);
  view.add(ViewMesh{ball.vertices, ball.list, 1}, at);
  at.size = {0.99 * radius, 0.99 * radius, 0.99 * radius};
  inner.add(at);
  int inside = 0;
  for (std::size_t k = 0; k < view.grid().pixels(); ++k) {
    if (inner.numbers()[k] == kNoSolid) continue;
    ++inside;
    ASSERT_EQ(view.numbers()[k], at.number) << k;
    ASSERT_LT(view.depth()[k], inner.depth()[k]) << k;
  }
  EXPECT_GT(inside, 5000);
}

TEST(SceneView, TrianglesBehindTheCameraAreCut) {
  // A long box through the picture's plane, whose upper face is 0.1 m below the camera.
  const Triangles box = box_of({0.5, 0.5, 5});
  ViewSolid at;
  at.axes = {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, 0, 1}};
  at.origin = {0, 0.6, 0};
  at.size = {0.5, 0.5, 5};
  at.number = 2;
  at.kind = SolidKind::cuboid;
  SceneView mesh(square_grid()), solid(square_grid());
  for (SceneView* view : {&mesh, &solid}) view->begin({0, -1, 0}, 0.3);
  mesh.add(ViewMesh{box.vertices, box.list, 1}, at);
  solid.add(at);
  EXPECT_GT(std::ranges::count(solid.numbers(), 2), 1000);
  for (std::size_t k = 0; k < mesh.grid().pixels(); ++k) {
    ASSERT_EQ(mesh.numbers()[k], solid.numbers()[k]) << k;
    ASSERT_NEAR(mesh.depth()[k], solid.depth()[k], 1e-6 * solid.depth()[k]) << k;
  }
}

/// Slabs that begin beside the camera and leave the picture at slants: their corners would be
/// millions of pixels away.
TEST(SceneView, MeshesMuchWiderThanThePictureKeepTheirSlants) {
  const Triangles box = box_of({2, 0.05, 2});
  for (int seed = 0; seed < 6; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::uniform_real_distribution<double> off(-0.6, 0.6);
    const double a = 0.4 * off(random), b = 0.5 * off(random);
    ViewSolid at;
    at.axes = {Vector3{std::cos(b), std::sin(b), 0},
               Vector3{-std::sin(b) * std::cos(a), std::cos(b) * std::cos(a), std::sin(a)},
               Vector3{std::sin(b) * std::sin(a), -std::cos(b) * std::sin(a), std::cos(a)}};
    at.origin = {off(random), 0.3 + 0.2 * off(random), 2};
    at.size = {2, 0.05, 2};
    at.number = 2;
    at.kind = SolidKind::cuboid;
    const ViewGrid narrow{256, 256, 12, 10};
    SceneView mesh(narrow), solid(narrow);
    for (SceneView* view : {&mesh, &solid}) view->begin({0, -1, 0}, 0.3);
    mesh.add(ViewMesh{box.vertices, box.list, 1}, at);
    solid.add(at);
    int other = 0;
    for (std::size_t k = 0; k < narrow.pixels(); ++k)
      other += mesh.numbers()[k] != solid.numbers()[k] ? 1 : 0;
    EXPECT_LE(other, 8) << seed;  // centres within 1/512 of a pixel of an edge
  }
}

TEST(SceneView, TheNearestOfTwoSolidsIsSeenInAnyOrder) {
  std::vector<Posed> all = posed_shapes(2);
  for (std::size_t k = 0; k < all.size(); ++k) all[k].solid.number = int(k);
  SceneView first(square_grid()), last(square_grid());
  for (SceneView* view : {&first, &last}) view->begin({0, 0, -1}, 0.3);
  for (const Posed& one : all) first.add(one.solid);
  std::ranges::reverse(all);
  for (const Posed& one : all) last.add(one.solid);
  EXPECT_THAT(first.numbers(), ::testing::ElementsAreArray(last.numbers()));
  EXPECT_THAT(first.depth(), ::testing::ElementsAreArray(last.depth()));
}

TEST(SceneView, ASolidAroundTheCameraIsNotSeen) {
  for (Posed& one : posed_shapes(0)) {
    one.solid.origin = {0, 0, 0.002};
    SceneView view(square_grid());
    view.begin({0, 0, -1}, 0.3);
    view.add(one.solid);
    EXPECT_THAT(view.numbers(), ::testing::Each(kNoSolid)) << shape_name(one.shape);
  }
}

TEST(SceneView, LightFollowsTheNormal) {
  Posed ball = posed_shapes(0)[0];
  ball.solid.origin = {0, 0, 0.3};
  ball.solid.colour = {1, 1, 1};
  SceneView view(square_grid());
  const Vector3 light = unit(Vector3{-0.6, -0.2, -0.7});
  view.begin(light, 0.25);
  view.add(ball.solid);
  int compared = 0;
  for (int i = 0; i < kPixels; ++i)
    for (int j = 0; j < kPixels; ++j) {
      const std::size_t k = std::size_t(i * kPixels + j);
      if (view.numbers()[k] == kNoSolid) continue;
      const Vector3 n = (1 / kSide) * (double(view.depth()[k]) * ray_of(i, j) - ball.solid.origin);
      const double level = 255 * (0.25 + 0.75 * std::max(0.0, dot(n, light)));
      ASSERT_NEAR(view.colours()[k] & 255U, level, 0.6) << i << ' ' << j;
      ++compared;
    }
  EXPECT_GT(compared, 150);
}

}  // namespace
}  // namespace tangere
