// SPDX-License-Identifier: Apache-2.0
// Tests the tactile kernels of every instruction set, in both precisions, across points and across
// environments, against one point at a time. Padding, culling and other contacts of the pad must
// not matter.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "kernels/contact/pair_contact.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::KernelTable;
using kernels::kTactileTile;
using kernels::PadTiles;
using kernels::Touch;
using kernels::TouchShape;
using kernels::Vec3;
using testing::Random;

Model pad_model(int rows, int cols) {
  Scene scene = testing::rolling_ball();
  scene.sensors[0].array.rows = rows;
  scene.sensors[0].array.cols = cols;
  return Model(scene);
}

/// 21 × 19 points: edge tiles in both directions and a corner tile.
const CompiledSensor& pad_sensor() {
  static const Model model = pad_model(21, 19);
  return compiled(model).sensors[0];
}

/// 19 × 17 tiles, so that spheres around eight of them are looked at first.
const CompiledSensor& large_pad_sensor() {
  static const Model model = pad_model(150, 130);
  return compiled(model).sensors[0];
}

/// The pad with NaN where an edge tile has no point. No NaN may reach a real point.
struct PoisonedPad {
  PadTiles tiles = pad_sensor().tiles();
  AlignedVector<double> offsets = pad_sensor().offsets;
  AlignedVector<float> offsets_f = pad_sensor().offsets_f;
  AlignedVector<double> far_reach, far_parts;

  PoisonedPad() {
    for (std::size_t k = 0; k < offsets.size(); ++k)
      if (std::abs(offsets[k]) > 1) {
        offsets[k] = std::numeric_limits<double>::quiet_NaN();
        offsets_f[k] = std::numeric_limits<float>::quiet_NaN();
      }
    tiles.offsets = offsets.data();
    tiles.offsets_f = offsets_f.data();
  }
  void stop_culling() {
    far_reach.assign(pad_sensor().tile_radius.size(), 1e9);
    tiles.radius = far_reach.data();
    far_parts.assign(4 * kernels::kGroup, 1e9);
    std::fill_n(far_parts.begin(), 3 * kernels::kGroup, 0.0);
    tiles.parts = far_parts.data();
    tiles.reach = 1e9;
  }
  [[nodiscard]] std::size_t numbers() const { return std::size_t(3 * tiles.rows * tiles.cols); }
  [[nodiscard]] Vec3<double> point(int row, int col) const {
    const int tile = row / 8 * tiles.tile_cols + col / 8, k = row % 8 * 8 + col % 8;
    const double* at = offsets.data() + 2 * kTactileTile * tiles.kind[tile];
    return {tiles.x[tile] + at[k], tiles.y[tile] + at[kTactileTile + k], 0};
  }
};

TouchShape shape_of(PrimitiveShape shape) {
  if (shape == PrimitiveShape::cylinder || shape == PrimitiveShape::capsule)
    return {shape, {0.012, 0.015, 0}};
  return shape == PrimitiveShape::sphere ? TouchShape{shape, {0.02, 0, 0}}
                                         : TouchShape{shape, {0.02, 0.015, 0.01}};
}
Vec3<double> size_of(const TouchShape& s) { return {s.size[0], s.size[1], s.size[2]}; }

/// Smallest distance of any point of the pad.
double deepest(const TouchShape& s, const Touch<double>& t) {
  static const PoisonedPad pad;
  return kernels::with_distance<double>(s.shape, size_of(s), [&](const auto& shape) {
    double least = INFINITY;
    for (int i = 0; i < pad.tiles.rows; ++i)
      for (int j = 0; j < pad.tiles.cols; ++j)
        least = std::min(least, distance_at(shape, transposed_times(t.Q, pad.point(i, j) - t.c)).d);
    return least;
  });
}

Touch<double> random_pose(Random& random) {
  Touch<double> t;
  t.Q = random.rotation();
  t.c = {random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(-0.012, 0.012)};
  t.omega = random.vector(2);
  t.v = random.vector(0.1);
  t.law = {30, 0.5, 0.8, 4};
  return t;
}

/// A moving shape that is sunk in the pad somewhere, in any orientation. Half-spaces leave a part
/// of the pad free. Rods and ellipsoids are sunk to half their radius: near the axis the normal
/// turns with the last digit of the position, in any precision.
Touch<double> random_touch(Random& random, const TouchShape& s) {
  const bool rod = s.shape == PrimitiveShape::cylinder || s.shape == PrimitiveShape::capsule ||
                   s.shape == PrimitiveShape::ellipsoid;
  const double thickness = s.shape == PrimitiveShape::ellipsoid ? s.size[2] : s.size[0];
  for (;;) {
    const Touch<double> t = random_pose(random);
    const double least = rod || s.shape == PrimitiveShape::plane ? deepest(s, t) : 0;
    if (rod && (least > -0.05 * thickness || least < -0.5 * thickness)) continue;
    if (s.shape == PrimitiveShape::plane && (least > -1e-3 || std::abs(t.Q.m[2][2]) > 0.9))
      continue;
    return t;
  }
}

Vec3<double> reference(const TouchShape& s, const Touch<double>& t, ContactLaw law,
                       const Vec3<double>& xi) {
  const kernels::LawParameters<double> p = {t.law, law, 0};
  const auto at = kernels::with_distance<double>(s.shape, size_of(s), [&](const auto& shape) {
    return point_contact(shape, p, t.Q, t.c, t.omega, t.v, xi);
  });
  return {at.force.x, at.force.y, -at.force.z};
}

int run(const KernelTable& table, const kernels::TactileArgs<double>& a) {
  return table.tactile(a);
}
int run(const KernelTable& table, const kernels::TactileArgs<float>& a) {
  return table.tactile_mixed(a);
}
void run(const KernelTable& table, const kernels::TactileBlockArgs<double>& a) {
  table.tactile_block(a);
}
void run(const KernelTable& table, const kernels::TactileBlockArgs<float>& a) {
  table.tactile_block_mixed(a);
}

template <class Real>
struct Result {
  std::vector<Real> dense, values;
  std::vector<int> active;
};

template <class Real>
Result<Real> field(const KernelTable& table, const PadTiles& pad, ContactLaw law,
                   const std::vector<TouchShape>& shapes, const std::vector<Touch<double>>& touches,
                   bool pressure = false) {
  Result<Real> r;
  const int components = pressure ? 1 : 3;
  AlignedVector<Real> values(std::size_t(pad.tiles() * components * kTactileTile), Real(-7));
  r.dense.assign(std::size_t(components * pad.rows * pad.cols), Real(0));
  r.active.resize(std::size_t(pad.tiles()));
  const int count =
      run(table, kernels::TactileArgs<Real>{&pad, law, static_cast<int>(shapes.size()),
                                            shapes.data(), touches.data(), r.active.data(),
                                            values.data(), r.dense.data(), pressure});
  r.active.resize(std::size_t(count));
  r.values.assign(values.begin(),
                  values.begin() + std::ptrdiff_t{components} * kTactileTile * count);
  return r;
}

struct Case {
  PrimitiveShape shape;
  ContactLaw law;
};
class TactileKernel : public ::testing::TestWithParam<Case> {};

template <class Real>
void expect_reference(const PoisonedPad& pad, const Case& c, const Touch<double>& touch,
                      const Result<Real>& got, double tolerance) {
  const TouchShape shape = shape_of(c.shape);
  std::vector<Vec3<double>> expected;
  double peak = 0;
  for (int i = 0; i < pad.tiles.rows; ++i)
    for (int j = 0; j < pad.tiles.cols; ++j) {
      expected.push_back(reference(shape, touch, c.law, pad.point(i, j)));
      peak = std::max(peak, std::sqrt(dot(expected.back(), expected.back())));
    }
  ASSERT_GT(peak, 0);
  for (std::size_t n = 0; n < expected.size(); ++n) {
    EXPECT_NEAR(got.dense[3 * n], expected[n].x, tolerance * peak);
    EXPECT_NEAR(got.dense[3 * n + 1], expected[n].y, tolerance * peak);
    EXPECT_NEAR(got.dense[3 * n + 2], expected[n].z, tolerance * peak);
  }
}

template <class Real>
void check_kernel(const Case& c, double tolerance) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const std::vector<Touch<double>> touch = {random_touch(random, shape_of(c.shape))};
    Result<Real> fused;
    for (const KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(std::string(table->name) + ", seed " + std::to_string(seed));
      PoisonedPad pad;
      const Result<Real> got = field<Real>(*table, pad.tiles, c.law, {shape_of(c.shape)}, touch);
      expect_reference(pad, c, touch[0], got, tolerance);
      pad.stop_culling();
      const Result<Real> all = field<Real>(*table, pad.tiles, c.law, {shape_of(c.shape)}, touch);
      EXPECT_EQ(all.dense, got.dense);
      EXPECT_EQ(all.active, got.active);
      if (std::string(table->name) == "avx512") fused = got;
      if (std::string(table->name) == "avx2" && !fused.dense.empty()) {
        EXPECT_EQ(got.dense, fused.dense);
      }
    }
  }
}

TEST_P(TactileKernel, DoubleMatchesOnePointAtATime) { check_kernel<double>(GetParam(), 1e-12); }
TEST_P(TactileKernel, MixedIsAMillionthOfThePeakAway) { check_kernel<float>(GetParam(), 1e-6); }

/// With a shape that sinks in, one beside the pad, and more shapes than have a bit.
template <class Real>
void check_eights(const Case& c) {
  PadTiles pad = large_pad_sensor().tiles(), all = pad;
  const AlignedVector<double> far_reach(large_pad_sensor().eight_radius.size(), 1e9);
  all.eight_radius = far_reach.data();
  for (unsigned seed = 1; seed <= 4; ++seed) {
    Random random(seed);
    const std::size_t count = seed == 4 ? 66 : 2;
    const std::vector<TouchShape> shapes(count, shape_of(c.shape));
    std::vector<Touch<double>> touches(count, random_touch(random, shapes[0]));
    touches[1].c = {0.05, 0.01, 0};
    touches.back() = random_touch(random, shapes[0]);
    for (const KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(std::string(table->name) + ", seed " + std::to_string(seed));
      for (const bool pressure : {false, true}) {
        const auto got = field<Real>(*table, pad, c.law, shapes, touches, pressure);
        const auto expected = field<Real>(*table, all, c.law, shapes, touches, pressure);
        EXPECT_EQ(got.active, expected.active);
        EXPECT_EQ(got.values, expected.values);
        EXPECT_EQ(got.dense, expected.dense);
        EXPECT_GT(got.active.size(), 0U);
      }
    }
  }
}
TEST_P(TactileKernel, SpheresAroundEightTilesLoseNone) {
  check_eights<double>(GetParam());
  check_eights<float>(GetParam());
}

/// Every point of a tile lies within the sphere around its eight.
TEST(TactileKernels, EightTilesLieWithinTheirSphere) {
  const PadTiles pad = large_pad_sensor().tiles();
  for (int t = 0; t < pad.tiles(); ++t) {
    const int eight = t / kernels::kGroup;
    const double x = pad.x[t] - pad.eight_x[eight], y = pad.y[t] - pad.eight_y[eight];
    EXPECT_LT(std::hypot(x, y) + pad.radius[t], pad.eight_radius[eight]) << t;
    EXPECT_LT(pad.eight_radius[eight], pad.reach);
  }
}

/// Every point lies within the sphere around some part, and the parts are small: a pad is not one
/// sphere.
TEST(TactileKernels, TilesLieWithinSpheresAroundParts) {
  const PadTiles pad = large_pad_sensor().tiles();
  double largest = 0;
  for (int t = 0; t < pad.tiles(); ++t) {
    bool within = false;
    for (int k = 0; k < kernels::kGroup; ++k) {
      const double* const part = pad.parts + k;
      const double radius = part[3 * kernels::kGroup];
      within =
          within ||
          std::hypot(pad.x[t] - part[0], pad.y[t] - part[kernels::kGroup]) + pad.radius[t] < radius;
      largest = std::max(largest, radius);
    }
    EXPECT_TRUE(within) << t;
  }
  EXPECT_LT(largest, 0.5 * pad.reach);
}

template <class Real>
void check_sum(const Case& c) {
  Random random(5);
  const std::vector<TouchShape> shapes = {shape_of(c.shape), shape_of(PrimitiveShape::sphere)};
  const std::vector<Touch<double>> touches = {random_touch(random, shapes[0]),
                                              random_touch(random, shapes[1])};
  for (const KernelTable* table : kernels::available_kernels()) {
    const PoisonedPad pad;
    const auto first = field<Real>(*table, pad.tiles, c.law, {shapes[0]}, {touches[0]});
    const auto second = field<Real>(*table, pad.tiles, c.law, {shapes[1]}, {touches[1]});
    const auto both = field<Real>(*table, pad.tiles, c.law, shapes, touches);
    for (std::size_t k = 0; k < both.dense.size(); ++k)
      EXPECT_EQ(both.dense[k], first.dense[k] + second.dense[k]);
  }
}
TEST_P(TactileKernel, ShapesAdd) {
  check_sum<double>(GetParam());
  check_sum<float>(GetParam());
}

template <class Real>
void check_tiles(const Case& c) {
  Random random(6);
  for (const KernelTable* table : kernels::available_kernels()) {
    const PoisonedPad pad;
    const auto got = field<Real>(*table, pad.tiles, c.law, {shape_of(c.shape)},
                                 {random_touch(random, shape_of(c.shape))});
    ASSERT_GT(got.active.size(), 0u);
    ASSERT_LT(got.active.size(), std::size_t(pad.tiles.tiles()));
    EXPECT_TRUE(std::is_sorted(got.active.begin(), got.active.end()));
    std::vector<Real> rebuilt(got.dense.size(), Real(0));
    for (std::size_t t = 0; t < got.active.size(); ++t) {
      const int tile = got.active[t];
      bool touched = false;
      for (int i = 0; i < pad.tiles.rows_of(tile); ++i)
        for (int j = 0; j < pad.tiles.cols_of(tile); ++j)
          for (int k = 0; k < 3; ++k) {
            const Real x =
                got.values[(3 * t + std::size_t(k)) * kTactileTile + std::size_t(8 * i + j)];
            rebuilt[std::size_t(3 * (pad.tiles.first_of(tile) + i * pad.tiles.cols + j) + k)] = x;
            touched |= x != 0;
          }
      EXPECT_TRUE(touched) << "tile " << tile;
    }
    EXPECT_EQ(rebuilt, got.dense);
  }
}
TEST_P(TactileKernel, TilesHoldTheDenseField) {
  check_tiles<double>(GetParam());
  check_tiles<float>(GetParam());
}

/// The pressure of two shapes at once, against one point at a time without friction.
template <class Real>
void check_pressure(const Case& c, double tolerance) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Random random(seed);
    const std::vector<TouchShape> shapes = {shape_of(c.shape), shape_of(PrimitiveShape::sphere)};
    std::vector<Touch<double>> touches = {random_touch(random, shapes[0]),
                                          random_touch(random, shapes[1])};
    for (const KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(std::string(table->name) + ", seed " + std::to_string(seed));
      const PoisonedPad pad;
      const auto got = field<Real>(*table, pad.tiles, c.law, shapes, touches, true);
      const auto whole = field<Real>(*table, pad.tiles, c.law, shapes, touches);
      EXPECT_EQ(got.active, whole.active);
      double peak = 0, off = 0;
      for (int n = 0; n < pad.tiles.rows * pad.tiles.cols; ++n) {
        double expected = 0;
        for (std::size_t k = 0; k < shapes.size(); ++k) {
          Touch<double> smooth = touches[k];
          smooth.law[1] = 0;
          expected +=
              reference(shapes[k], smooth, c.law, pad.point(n / pad.tiles.cols, n % pad.tiles.cols))
                  .z;
        }
        peak = std::max(peak, std::abs(expected));
        off = std::max(off, std::abs(double(got.dense[std::size_t(n)]) - expected));
      }
      EXPECT_GT(peak, 0);
      EXPECT_LE(off, tolerance * peak);
    }
  }
}
TEST_P(TactileKernel, PressureIsThatOfPointsWithoutFriction) {
  check_pressure<double>(GetParam(), 1e-12);
  check_pressure<float>(GetParam(), 1e-6);
}

/// Sixteen environments. Nobody reads those of `absent`, which hold NaN.
template <class Real>
void check_block(const Case& c, bool pressure) {
  constexpr int kLanes = std::is_same_v<Real, float> ? 16 : 8;
  Random random(9);
  for (const KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    const PoisonedPad pad;
    const TouchShape shape = shape_of(c.shape);
    std::vector<Touch<double>> touches;
    AlignedVector<Touch<kernels::LaneRow>> rows(2);
    for (int l = 0; l < kLanes; ++l) {
      touches.push_back(random_touch(random, shape));
      if (l % 7 == 3) touches.back().c.z = 1;  // touches nothing
      if (l == 5)
        touches.back().c.x = touches.back().v.y = std::numeric_limits<double>::quiet_NaN();
      const auto* from = reinterpret_cast<const double*>(&touches.back());
      auto* to = reinterpret_cast<kernels::LaneRow*>(&rows[std::size_t(l / kernels::kGroup)]);
      for (std::size_t k = 0; k < sizeof(Touch<double>) / sizeof(double); ++k)
        to[k].lane[l % kernels::kGroup] = from[k];
    }
    const Touch<kernels::LaneRow>* of_shape[] = {rows.data()};
    std::vector<std::vector<Real>> dense(
        kLanes, std::vector<Real>(pad.numbers() / (pressure ? 3 : 1), Real(0)));
    std::vector<Real*> arrays;
    for (auto& d : dense) arrays.push_back(d.data());
    arrays[5] = nullptr;
    run(*table, kernels::TactileBlockArgs<Real>{&pad.tiles, c.law, 1, &shape, of_shape,
                                                arrays.data(), pressure});
    for (int l = 0; l < kLanes; ++l) {
      if (l == 5) continue;
      const auto alone =
          field<Real>(*table, pad.tiles, c.law, {shape}, {touches[std::size_t(l)]}, pressure);
      EXPECT_EQ(dense[std::size_t(l)], alone.dense) << "lane " << l;
    }
  }
}
TEST_P(TactileKernel, AnEnvironmentHasTheSameBitsAcrossPointsAndAcrossEnvironments) {
  for (const bool pressure : {false, true}) {
    check_block<double>(GetParam(), pressure);
    check_block<float>(GetParam(), pressure);
  }
}

TEST_P(TactileKernel, AxesThatAreNotQuitePerpendicularGetTheirOwnComponents) {
  Random random(11);
  const std::vector<Touch<double>> touch = {random_touch(random, shape_of(GetParam().shape))};
  for (const KernelTable* table : kernels::available_kernels()) {
    PoisonedPad pad;
    const auto plain =
        field<double>(*table, pad.tiles, GetParam().law, {shape_of(GetParam().shape)}, touch);
    pad.tiles.skewed = true;
    const double axes[9] = {1, 2e-4, 0, -1e-4, 1, 0, 1e-5, 0, -1};
    std::copy(axes, axes + 9, pad.tiles.axes);
    const auto skewed =
        field<double>(*table, pad.tiles, GetParam().law, {shape_of(GetParam().shape)}, touch);
    double peak = 0;
    for (const double x : plain.dense) peak = std::max(peak, std::abs(x));
    for (std::size_t n = 0; n < plain.dense.size(); n += 3) {
      const double f[3] = {plain.dense[n], plain.dense[n + 1], -plain.dense[n + 2]};
      for (std::size_t i = 0; i < 3; ++i)
        EXPECT_NEAR(skewed.dense[n + i],
                    axes[3 * i] * f[0] + axes[3 * i + 1] * f[1] + axes[3 * i + 2] * f[2],
                    1e-15 * peak);
    }
  }
}

/// A rod's axis through a point of the pad, along and across it; a corner of its rim in the pad; a
/// face in the pad's plane. Forces are finite and equal one point at a time in double precision.
TEST_P(TactileKernel, KinksHaveTheForceOfOnePoint) {
  const TouchShape shape = shape_of(GetParam().shape);
  const PoisonedPad pad;
  const Vec3<double> on = pad.point(9, 8);
  Random random(12);
  for (const double turn : {0.0, 1.0}) {
    for (const double lift : {0.0, shape.size[1], shape.size[0], -shape.size[0]}) {
      Touch<double> t = random_pose(random);
      t.Q = turn == 0 ? kernels::diagonal(1.0)
                      : kernels::Mat3<double>{
                            {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}};  // the axis lies in the pad
      t.c = {on.x, on.y, lift};
      for (const KernelTable* table : kernels::available_kernels()) {
        SCOPED_TRACE(std::string(table->name) + ", turn " + std::to_string(turn) + ", lift " +
                     std::to_string(lift));
        const auto got = field<double>(*table, pad.tiles, GetParam().law, {shape}, {t});
        const Vec3<double> expected = reference(shape, t, GetParam().law, on);
        const std::size_t n = std::size_t(3 * (9 * pad.tiles.cols + 8));
        EXPECT_NEAR(got.dense[n], expected.x, 1e-12);
        EXPECT_NEAR(got.dense[n + 1], expected.y, 1e-12);
        EXPECT_NEAR(got.dense[n + 2], expected.z, 1e-12);
        for (const double x : got.dense) EXPECT_TRUE(std::isfinite(x));
        for (const float x : field<float>(*table, pad.tiles, GetParam().law, {shape}, {t}).dense)
          EXPECT_TRUE(std::isfinite(x));
      }
    }
  }
}

std::vector<Case> shapes_and_laws() {
  std::vector<Case> cases;
  for (int shape = 0; shape < static_cast<int>(PrimitiveShape::mesh); ++shape)
    for (const ContactLaw law : {ContactLaw::clamped, ContactLaw::paper})
      cases.push_back({static_cast<PrimitiveShape>(shape), law});
  return cases;
}
INSTANTIATE_TEST_SUITE_P(Shapes, TactileKernel, ::testing::ValuesIn(shapes_and_laws()));

}  // namespace
}  // namespace tangere
