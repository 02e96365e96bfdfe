// SPDX-License-Identifier: Apache-2.0
// Compares readings of a coupled layer with finite elements of a gel (tests/data/README.md).
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "engine/sense/readout.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using Numbers = std::vector<double>;
constexpr int kRows = 24, kCols = 32;  // taxels of 0.75 mm

/// `each`: numbers of a taxel.
Numbers truth(const std::string& name, std::size_t each = 1) {
  std::ifstream file(std::string(TANGERE_TEST_DATA) + "/gel/" + name + ".txt");
  std::string line;
  std::getline(file, line);
  Numbers out;
  for (double x; file >> x;) out.push_back(x);
  EXPECT_EQ(out.size(), each * kRows * kCols) << name;
  return out;
}

/// A gel of 20.75 × 25.25 × 4 mm, of which 18 × 24 mm have points 0.375 mm apart, and `indenters`
/// that slide along z and touch it with their lowest points at z = 0.
Scene gel(const std::vector<std::pair<Shape, Vector3>>& indenters, double cell) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {testing::link("plate", JointType::fixed, {0, 0, -0.005},
                           CuboidShape{{0.018, 0.024, 0.01}, {2, 2, 2}}, 1000)};
  for (const auto& [shape, place] : indenters) {
    s.links.push_back(testing::link("indenter" + std::to_string(s.links.size()),
                                    JointType::prismatic, place, shape, 1000));
    s.links.back().joint.axis0 = {0, 0, 1};
  }
  TactileDescription t;
  t.name = "gel";
  t.body = "plate";
  t.array = {{-0.0088125, -0.0118125, 0.005},
             {0.0088125, 0.0118125, 0.005},
             {1, 0, 0},
             {0, 1, 0},
             2 * kRows,
             2 * kCols};
  t.material = SkinMaterial{0.428e6, 4e-3, 0};
  t.layer = LayerDescription{0.475, cell, 1e-3, {}};
  t.coefficients = {40, 0, 0, 0};
  s.sensors.push_back(t);
  return s;
}

struct Errors {
  double field, total;  ///< relative: norm of the difference, and of the sums
};

Errors errors(const Scene& scene, double depth, const std::string& name) {
  const Model model(scene);
  Batch batch(model, 1, 0);
  batch.set_state(0, Numbers(std::size_t(model.nq()), -depth), Numbers(std::size_t(model.nv())));
  Numbers field(std::size_t(3 * model.sensors()[0].points)), taxels(kRows * kCols);
  Readout(model).tactile(batch, 0, 0, field);
  for (int i = 0; i < 2 * kRows; ++i)
    for (int j = 0; j < 2 * kCols; ++j)
      taxels[std::size_t(i / 2 * kCols + j / 2)] += field[std::size_t(3 * (i * 2 * kCols + j) + 2)];
  const Numbers right = truth(name);
  double off = 0, square = 0, sum = 0, right_sum = 0;
  for (std::size_t k = 0; k < taxels.size(); ++k) {
    off += (taxels[k] - right[k]) * (taxels[k] - right[k]);
    square += right[k] * right[k];
    sum += taxels[k], right_sum += right[k];
  }
  const Errors e = {std::sqrt(off / square), sum / right_sum - 1};
  ::testing::Test::RecordProperty(name + "_field", std::to_string(e.field));
  return e;
}

TEST(LayerTruth, ABallFromFlatToDeep) {
  const Scene s = gel({{SphereShape{7.5e-3}, {0, 0, 7.5e-3}}}, 0.75e-3);
  const struct {
    double depth;
    const char* name;
    double field, total;
  } rows[] = {{0.25e-3, "ball75_0250", 0.09, 0.10},
              {0.5e-3, "ball75_0500", 0.08, 0.09},
              {1e-3, "ball75_1000", 0.08, 0.09},
              {1.5e-3, "ball75_1500", 0.09, 0.09}};
  for (const auto& r : rows) {
    const Errors e = errors(s, r.depth, r.name);
    EXPECT_LT(e.field, r.field) << r.name;
    EXPECT_LT(std::abs(e.total), r.total) << r.name << " " << e.total;
  }
}

/// Two bodies on one pad yield to each other.
TEST(LayerTruth, TwoBallsSideBySide) {
  const Scene s = gel(
      {{SphereShape{3e-3}, {3.5e-3, 0, 3e-3}}, {SphereShape{3e-3}, {-3.5e-3, 0, 3e-3}}}, 0.75e-3);
  for (const auto& [depth, name] : {std::pair{0.5e-3, "balls3_0500"}, {1e-3, "balls3_1000"}}) {
    const Errors e = errors(s, depth, name);
    EXPECT_LT(e.field, 0.16) << name;
    EXPECT_LT(std::abs(e.total), 0.13) << name << " " << e.total;
  }
}

/// A flat punch, here with a sharp edge, there with one of 0.25 mm.
TEST(LayerTruth, AFlatPunchIsCarriedByItsEdge) {
  Scene s = gel({{CylinderShape{0.01, 4e-3, 8, 2}, {0, 0, 5e-3}}}, 0.75e-3);
  const Errors e = errors(s, 0.25e-3, "punch4_0250");
  EXPECT_LT(e.field, 0.28);
  EXPECT_LT(std::abs(e.total), 0.12) << e.total;
}

/// Errors of the surface's motion at least two taxels from the contact: norms of the difference
/// over those of the truth.
struct MotionErrors {
  double lateral, bulge;
};

MotionErrors motion_errors(Scene scene, double depth, const std::string& name) {
  scene.sensors[0].markers.emplace();
  const Model model(scene);
  Batch batch(model, 1, 0);
  batch.set_state(0, Numbers(std::size_t(model.nq()), -depth), Numbers(std::size_t(model.nv())));
  Numbers points(std::size_t(3 * model.sensors()[0].points)), taxels(3 * kRows * kCols);
  const std::span<double> to(points);
  Readout(model).read_block(batch, 0, {0, FieldForm::surface}, {&to, 1});
  for (std::size_t p = 0; p < points.size(); ++p) {  // means of 2 × 2 points
    const std::size_t i = p / 3 / (2 * kCols) / 2, j = p / 3 % (2 * kCols) / 2;
    taxels[3 * (i * kCols + j) + p % 3] += 250 * points[p];  // mm
  }
  const Numbers force = truth(name), right = truth(name + "_motion", 3);
  const auto outside = [&](int i, int j) {
    for (int a = std::max(0, i - 2); a <= std::min(kRows - 1, i + 2); ++a)
      for (int b = std::max(0, j - 2); b <= std::min(kCols - 1, j + 2); ++b)
        if (force[std::size_t(a * kCols + b)] != 0) return false;
    return true;
  };
  double off[2] = {}, size[2] = {};
  for (std::size_t k = 0; k < right.size(); ++k)
    if (outside(int(k / 3) / kCols, int(k / 3) % kCols)) {
      const std::size_t part = k % 3 == 2 ? 1 : 0;
      off[part] += (taxels[k] - right[k]) * (taxels[k] - right[k]),
          size[part] += right[k] * right[k];
    }
  return {std::sqrt(off[0] / size[0]), std::sqrt(off[1] / size[1])};
}

/// Without sides the bulges have errors of 0.4 to 0.5.
TEST(LayerTruth, TheSurfaceMovesOutsideTheContact) {
  Scene ball = gel({{SphereShape{7.5e-3}, {0, 0, 7.5e-3}}}, 0.75e-3);
  Scene balls = gel(
      {{SphereShape{3e-3}, {3.5e-3, 0, 3e-3}}, {SphereShape{3e-3}, {-3.5e-3, 0, 3e-3}}}, 0.75e-3);
  const std::tuple<Scene*, double, const char*> rows[] = {{&ball, 0.5e-3, "ball75_0500"},
                                                          {&ball, 1e-3, "ball75_1000"},
                                                          {&balls, 0.5e-3, "balls3_0500"}};
  for (const auto& [scene, depth, name] : rows) {
    const MotionErrors e = motion_errors(*scene, depth, name);
    EXPECT_LT(e.lateral, 0.18) << name;
    EXPECT_LT(e.bulge, 0.32) << name;
    RecordProperty(std::string(name) + "_lateral", std::to_string(e.lateral));
    RecordProperty(std::string(name) + "_bulge", std::to_string(e.bulge));
  }
}

/// Smaller cells are better.
TEST(LayerTruth, SmallerCells) {
  const std::vector<std::pair<Shape, Vector3>> ball = {{SphereShape{7.5e-3}, {0, 0, 7.5e-3}}};
  EXPECT_LT(errors(gel(ball, 0.75e-3), 0.5e-3, "ball75_0500").total,
            errors(gel(ball, 1.5e-3), 0.5e-3, "ball75_0500").total);
}

}  // namespace
}  // namespace tangere
