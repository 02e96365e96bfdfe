// SPDX-License-Identifier: Apache-2.0
// Tests pads whose points have their own positions, axes and coefficients: kernels against one
// point at a time, and readings against each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/sense/readout.hpp"
#include "kernels/contact/pair_contact.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/runs.hpp"
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

Vector3 array_of(const Vec3<double>& a) { return {a.x, a.y, a.z}; }
Vec3<double> vec(const Vector3& a) { return {a[0], a[1], a[2]}; }

/// Points on a wave 4 cm wide, in random order, with axes that follow it.
std::vector<TactilePoint> wave(int count, bool own_factors) {
  Random random(3);
  std::vector<TactilePoint> points;
  for (int i = 0; i < count; ++i) {
    const double x = random.uniform(-0.02, 0.02), y = random.uniform(-0.02, 0.02),
                 turn = random.uniform(0, 6);
    const double slope = 0.3 * std::cos(100 * x), length = std::sqrt(1 + slope * slope);
    const Vec3<double> normal = (1 / length) * Vec3<double>{-slope, 0, 1},
                       along = (1 / length) * Vec3<double>{1, 0, slope};
    const Vec3<double> axis0 = std::cos(turn) * along + std::sin(turn) * cross(normal, along);
    TactilePoint p;
    p.position = {x, y, 0.003 * std::sin(100 * x)};
    p.normal = array_of(normal);
    p.axis0 = array_of(axis0);
    p.axis1 = array_of(cross(normal, axis0));
    if (own_factors)
      p.factors = {random.uniform(0.5, 2), random.uniform(0.5, 2), random.uniform(0.5, 2),
                   random.uniform(0.5, 2)};
    points.push_back(p);
  }
  return points;
}

Scene curved_ball(int count, bool own_factors = false) {
  Scene scene = testing::rolling_ball();
  scene.sensors[0].points = wave(count, own_factors);
  // The wave is below the pad's body and faces down, so it is turned over.
  for (TactilePoint& p : scene.sensors[0].points)
    for (Vector3* a : {&p.position, &p.normal, &p.axis0, &p.axis1})
      (*a)[1] = -(*a)[1], (*a)[2] = -(*a)[2];
  for (TactilePoint& p : scene.sensors[0].points) p.position[2] -= 0.005;
  return scene;
}

TouchShape shape_of(PrimitiveShape shape) {
  if (shape == PrimitiveShape::cylinder || shape == PrimitiveShape::capsule)
    return {shape, {0.012, 0.015, 0}};
  return shape == PrimitiveShape::sphere ? TouchShape{shape, {0.02, 0, 0}}
                                         : TouchShape{shape, {0.02, 0.015, 0.01}};
}

/// Touches the wave from below, to a depth of some of the shape's extent.
Touch<double> random_touch(Random& random, const TouchShape& s) {
  static const Scene scene = curved_ball(300);
  Touch<double> t;
  t.Q = random.rotation();
  t.omega = random.vector(2);
  t.v = random.vector(0.1);
  t.law = {30, 0.5, 0.8, 4};
  for (double height = 0.04;; height -= 1e-3) {
    t.c = {random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01), -0.005 - height};
    double least = 1;
    for (const TactilePoint& p : scene.sensors[0].points)
      least = std::min(
          least, kernels::with_distance<double>(
                     s.shape, {s.size[0], s.size[1], s.size[2]}, [&](const auto& shape) {
                       return distance_at(shape, transposed_times(t.Q, vec(p.position) - t.c)).d;
                     }));
    if (least < -5e-4) return t;
  }
}

Vec3<double> reference(const TouchShape& s, const Touch<double>& t, ContactLaw law,
                       const TactilePoint& p) {
  const kernels::LawParameters<double> own = {
      {t.law.kn * p.factors[0], t.law.kt * p.factors[1], t.law.mu * p.factors[2],
       t.law.damping * p.factors[3]},
      law,
      0};
  const Vec3<double> f = kernels::with_distance<double>(
      s.shape, {s.size[0], s.size[1], s.size[2]}, [&](const auto& shape) {
        return point_contact(shape, own, t.Q, t.c, t.omega, t.v, vec(p.position)).force;
      });
  return {dot(f, vec(p.axis0)), dot(f, vec(p.axis1)), -dot(f, vec(p.normal))};
}

int run(const KernelTable& table, const kernels::TactileArgs<double>& a) {
  return table.tactile(a);
}
int run(const KernelTable& table, const kernels::TactileArgs<float>& a) {
  return table.tactile_mixed(a);
}

/// Returns (points, 3). Writes the touched tiles to `active`.
template <class Real>
std::vector<Real> field(const KernelTable& table, const PadTiles& pad, ContactLaw law,
                        const TouchShape& shape, const Touch<double>& touch,
                        std::vector<int>& active) {
  std::vector<Real> dense(std::size_t(3 * pad.rows), Real(0));
  AlignedVector<Real> values(std::size_t(pad.tiles() * 3 * kTactileTile));
  active.resize(std::size_t(pad.tiles()));
  const kernels::TactileArgs<Real> args{&pad,          law,           1,           &shape, &touch,
                                        active.data(), values.data(), dense.data()};
  active.resize(std::size_t(run(table, args)));
  return dense;
}

struct Case {
  PrimitiveShape shape;
  ContactLaw law;
  bool own_factors;
};
class CurvedPad : public ::testing::TestWithParam<Case> {};

template <class Real>
void check(const Case& c, double tolerance) {
  const Model model(curved_ball(300, c.own_factors));
  const std::vector<TactilePoint>& points = model.scene().sensors[0].points;
  PadTiles pad = compiled(model).sensors[0].tiles();
  ASSERT_EQ(pad.tiles(), 5);
  // The padding of the last tile holds NaN, which must reach no real point.
  AlignedVector<double> offsets = compiled(model).sensors[0].offsets;
  AlignedVector<float> offsets_f = compiled(model).sensors[0].offsets_f;
  for (std::size_t k = 0; k < offsets.size(); ++k)
    if (std::abs(offsets[k]) > 1) {
      offsets[k] = std::numeric_limits<double>::quiet_NaN();
      offsets_f[k] = std::numeric_limits<float>::quiet_NaN();
    }
  pad.offsets = offsets.data(), pad.offsets_f = offsets_f.data();
  const AlignedVector<double> far_reach(compiled(model).sensors[0].tile_radius.size(), 1e9);
  PadTiles unculled = pad;
  unculled.radius = far_reach.data();
  AlignedVector<double> far_parts(4 * kernels::kGroup, 1e9);
  std::fill_n(far_parts.begin(), 3 * kernels::kGroup, 0.0);
  unculled.parts = far_parts.data();
  unculled.reach = 1e9;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Random random(seed);
    const TouchShape shape = shape_of(c.shape);
    const Touch<double> touch = random_touch(random, shape);
    std::vector<Vec3<double>> expected;
    double peak = 0;
    for (const TactilePoint& p : points) {
      expected.push_back(reference(shape, touch, c.law, p));
      peak = std::max(peak, std::sqrt(dot(expected.back(), expected.back())));
    }
    ASSERT_GT(peak, 0);
    std::vector<Real> fused;
    for (const KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(std::string(table->name) + ", seed " + std::to_string(seed));
      std::vector<int> active, all_active;
      const std::vector<Real> got = field<Real>(*table, pad, c.law, shape, touch, active);
      for (std::size_t n = 0; n < expected.size(); ++n) {
        EXPECT_NEAR(got[3 * n], expected[n].x, tolerance * peak);
        EXPECT_NEAR(got[3 * n + 1], expected[n].y, tolerance * peak);
        EXPECT_NEAR(got[3 * n + 2], expected[n].z, tolerance * peak);
      }
      EXPECT_EQ(field<Real>(*table, unculled, c.law, shape, touch, all_active), got);
      EXPECT_EQ(all_active, active);
      if (std::string(table->name) == "avx512") fused = got;
      if (std::string(table->name) == "avx2" && !fused.empty()) {
        EXPECT_EQ(got, fused);
      }
    }
  }
}

TEST_P(CurvedPad, DoubleMatchesOnePointAtATime) { check<double>(GetParam(), 1e-12); }
// Tiles are a centimetre wide, not two millimetres, so the rounding of offsets weighs more.
TEST_P(CurvedPad, MixedIsAFewMillionthsOfThePeakAway) { check<float>(GetParam(), 5e-6); }

INSTANTIATE_TEST_SUITE_P(
    Shapes, CurvedPad,
    ::testing::Values(Case{PrimitiveShape::sphere, ContactLaw::clamped, false},
                      Case{PrimitiveShape::sphere, ContactLaw::paper, true},
                      Case{PrimitiveShape::cuboid, ContactLaw::clamped, true},
                      Case{PrimitiveShape::plane, ContactLaw::clamped, true},
                      Case{PrimitiveShape::cylinder, ContactLaw::clamped, true},
                      Case{PrimitiveShape::ellipsoid, ContactLaw::clamped, true},
                      Case{PrimitiveShape::capsule, ContactLaw::paper, true}));

/// Puts the ball under the wave of environment e.
void press(Batch& batch, int e, double depth, double where) {
  std::vector<double> q = testing::q_of(batch, e), v = testing::v_of(batch, e);
  q[2] = -0.012 - depth;
  q[3] = 8e-3 * std::sin(where), q[4] = 5e-3 * std::cos(2 * where);
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = 0.05 * std::sin(where + double(i));
  batch.set_state(e, q, v);
}

template <class T>
void check_readings(Precision precision) {
  const Model model(curved_ball(300, true));
  Readout readout(model, precision);
  Batch batch(model, 19);
  DenseFrame<T> dense(model, 0);
  CompactFrame<T> compact(model, 0);
  std::vector<DenseFrame<T>> block;
  for (int e = 0; e < 16; ++e) block.emplace_back(model, 0);
  int touched = 0;
  for (int moment = 0; moment < 4; ++moment) {
    for (int e = 0; e < 19; ++e)
      press(batch, e, (e + moment) % 5 == 4 ? -5e-3 : 2e-3 + 5e-4 * (e % 5), e + 0.7 * moment);
    readout.read_block(batch, 0, std::span(block));
    for (int e = 0; e < 19; ++e) {
      std::vector<T> whole(900, T(-3)), expanded(900, T(-3));
      readout.tactile(batch, e, 0, whole);
      touched += std::any_of(whole.begin(), whole.end(), [](T x) { return x != 0; }) ? 1 : 0;
      readout.read(batch, e, dense);
      EXPECT_TRUE(std::equal(whole.begin(), whole.end(), dense.values().begin()))
          << "environment " << e;
      readout.read(batch, e, compact);
      compact.expand(expanded);
      EXPECT_EQ(expanded, whole) << "environment " << e;
      if (e < 16) {
        EXPECT_TRUE(std::equal(whole.begin(), whole.end(), block[std::size_t(e)].values().begin()))
            << "environment " << e;
      }
    }
  }
  EXPECT_GT(touched, 30);
  EXPECT_LT(touched, 4 * 19);
}

TEST(CurvedPad, EveryWayOfReadingGivesTheSameBits) {
  check_readings<double>(Precision::f64);
  check_readings<float>(Precision::mixed);
  check_readings<double>(Precision::mixed);
  check_readings<float>(Precision::f64);
}

TEST(CurvedPad, OrderInTheListIsOrderInTheField) {
  Scene scene = curved_ball(300), other = scene;
  std::reverse(other.sensors[0].points.begin(), other.sensors[0].points.end());
  const Model first(scene), second(other);
  Batch a(first, 1), b(second, 1);
  press(a, 0, 1e-3, 1);
  press(b, 0, 1e-3, 1);
  std::vector<double> f(900), g(900);
  Readout(first).tactile(a, 0, 0, f);
  Readout(second).tactile(b, 0, 0, g);
  double peak = 0;
  for (const double x : f) peak = std::max(peak, std::abs(x));
  EXPECT_GT(peak, 0);
  for (std::size_t n = 0; n < 300; ++n)
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(f[3 * n + k], g[3 * (299 - n) + k], 1e-13 * peak);
}

TEST(CurvedPad, AFlatListReadsWhatTheArrayReads) {
  Scene scene = testing::rolling_ball(false, 24), list = scene;
  const RectArray& a = scene.sensors[0].array;
  const Vec3<double> axis0 = vec(a.axis0), axis1 = vec(a.axis1), normal = cross(axis0, axis1);
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < 24; ++j) {
      TactilePoint p;
      p.position = array_of(vec(a.corner0) + (0.05 / 23 * i) * axis0 + (0.05 / 23 * j) * axis1);
      p.axis0 = a.axis0, p.axis1 = a.axis1, p.normal = array_of(normal);
      list.sensors[0].points.push_back(p);
    }
  const Model first(scene), second(list);
  EXPECT_EQ(first.sensors()[0].pressure_sign, second.sensors()[0].pressure_sign);
  EXPECT_EQ(second.sensors()[0].rows, 0);
  Batch x(first, 1), y(second, 1);
  press(x, 0, 4e-3, 1);
  press(y, 0, 4e-3, 1);
  std::vector<double> f(3 * 24 * 24), g(f.size());
  Readout(first).tactile(x, 0, 0, f);
  Readout(second).tactile(y, 0, 0, g);
  double peak = 0;
  for (const double v : f) peak = std::max(peak, std::abs(v));
  EXPECT_GT(peak, 0);
  for (std::size_t n = 0; n < f.size(); ++n) EXPECT_NEAR(f[n], g[n], 1e-12 * peak);
}

}  // namespace
}  // namespace tangere
