// SPDX-License-Identifier: Apache-2.0
// Tests fields along a direction against dual numbers and against fields in reverse, and every
// point's own numbers by three routes.
#include <gtest/gtest.h>

#include <numeric>

#include "engine/derivative/field_tangent.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/sense/readout.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/pad_scene.hpp"

namespace tangere {
namespace {

using testing::kBlock;
using testing::Pad;
using testing::PadState;
using testing::Random;

std::vector<double> normals(Random& random, std::size_t n, double size = 1) {
  std::vector<double> x(n);
  for (double& a : x) a = size * random.normal();
  return x;
}
double inner_product(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

/// A state in lane `lane` of a block, its field, and a tape that begins with it.
struct Placed {
  Batch batch;
  BlockTape tape;
  CompactFrame<double> frame;

  Placed(const Model& model, const PadState& s, int lane)
      : batch(model, kBlock), tape(model, Integrator::bdf1, 1), frame(model, 0) {
    batch.set_state(lane, s.q, s.v);
    tape.start(batch, 0);
    Readout(model).read(batch, lane, frame);
  }
  /// Change of the whole field, in dual numbers.
  std::vector<double> by_duals(int lane, const std::vector<double>& points_dot,
                               const StateTangent& state) {
    std::vector<double> change(frame.dense_size());
    Tangent(batch.model()).field(batch, 0, lane, tape, 0, 0, {}, points_dot, state, change);
    return change;
  }
};

using Case = std::tuple<PrimitiveShape, ContactLaw, Pad>;
class AlongADirection : public ::testing::TestWithParam<Case> {};

/// The three routes agree on every instruction set and with other states in the neighbouring lanes.
TEST_P(AlongADirection, MatchesDualNumbersAndTheReverse) {
  const auto [shape, law, pad] = GetParam();
  const Model model(testing::pad_scene(shape, law, pad));
  Random random(11);
  const kernels::KernelTable& before = kernels::active_kernels();
  double seen = 0;
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    kernels::use_kernels(*table);
    for (int trial = 0; trial < 3; ++trial) {
      const PadState s = testing::random_pad_state(model, random);
      const int lane = (7 * trial + 2) % kBlock;
      Placed placed(model, s, lane);
      const auto nv = std::size_t(model.nv());
      const StateTangent d{normals(random, nv, 0.01), normals(random, nv), {}, {}};
      FieldTangent forward(model);
      forward.place(placed.batch, 0);
      forward.move(lane, d.q, d.v);
      std::vector<double> change(placed.frame.values().size(), NAN),
          dense(placed.frame.dense_size());
      forward.field(0, placed.frame.tiles(), change);
      placed.frame.spread(change, dense);
      const std::vector<double> expected = placed.by_duals(lane, {}, d);
      const double size = std::sqrt(inner_product(expected, expected));
      for (std::size_t i = 0; i < dense.size(); ++i)
        ASSERT_NEAR(dense[i], expected[i], 1e-12 * size) << table->name;
      seen += size;

      const std::vector<double> weights = normals(random, dense.size());
      ReadoutPullback pullback(model);
      BlockCotangent c;
      for (auto* x : {&c.q, &c.v}) x->assign(nv * kBlock, 0.0);
      pullback.place(placed.batch, 0);
      pullback.clear();
      pullback.dense_field(lane, 0, weights);
      pullback.finish(c);
      double back = 0;
      for (std::size_t i = 0; i < nv; ++i)
        back += c.q[i * kBlock + std::size_t(lane)] * d.q[i] +
                c.v[i * kBlock + std::size_t(lane)] * d.v[i];
      EXPECT_NEAR(inner_product(weights, dense), back,
                  1e-12 * size * std::sqrt(inner_product(weights, weights)))
          << table->name;
    }
  }
  kernels::use_kernels(before);
  EXPECT_GT(seen, 0);
}

/// The scene with one number of every point of its sensor moved by e times a direction.
Scene moved_points(Scene s, std::size_t number, const std::vector<double>& direction, double e) {
  TactileDescription& t = s.sensors[0];
  t.pressure_sign = 1;
  std::vector<double> change(direction.size() * kPointNumbers);
  for (std::size_t i = 0; i < direction.size(); ++i)
    change[i * kPointNumbers + number] = e * direction[i];
  add_to_points(t, change);
  return s;
}

std::vector<double> field_of(const Scene& scene, const PadState& s) {
  const Model model(scene);
  Batch batch(model, 1);
  batch.set_state(0, s.q, s.v);
  std::vector<double> field(std::size_t(3 * model.sensors()[0].points));
  Readout(model).tactile(batch, 0, 0, field);
  return field;
}

TEST_P(AlongADirection, PointsHaveDerivativesByNumbersOfTheirOwn) {
  const auto [shape, law, pad] = GetParam();
  const Scene scene = testing::pad_scene(shape, law, pad);
  const Model model(scene);
  const kernels::KernelTable& before = kernels::active_kernels();
  const auto tables = kernels::available_kernels();
  Random random(5);
  int compared = 0;
  for (int trial = 0; trial < 4; ++trial) {
    kernels::use_kernels(*tables[std::size_t(trial) % tables.size()]);
    const PadState s = testing::random_pad_state(model, random);
    const int lane = (5 * trial + 1) % kBlock;
    Placed placed(model, s, lane);
    const std::size_t points = std::size_t(model.sensors()[0].points);
    EXPECT_EQ(tactile_points(model), model.sensors()[0].points);
    const std::vector<double> weights = normals(random, placed.frame.dense_size());
    ReadoutPullback pullback(model);
    std::vector<double> gradient(points * kPointNumbers);
    pullback.place(placed.batch, 0);
    pullback.clear();
    pullback.dense_field(lane, 0, weights, {}, gradient);
    const std::vector<double> zero(std::size_t(model.nv()));
    for (std::size_t number = 0; number < kPointNumbers; ++number) {
      const std::vector<double> direction = normals(random, points);
      std::vector<double> d(points * kPointNumbers), g(points);
      for (std::size_t i = 0; i < points; ++i)
        d[i * kPointNumbers + number] = direction[i], g[i] = gradient[i * kPointNumbers + number];
      const std::vector<double> change = placed.by_duals(lane, d, {zero, zero, {}, {}});
      const double back = inner_product(gradient, d),
                   size =
                       std::sqrt(inner_product(weights, weights) * inner_product(change, change));
      EXPECT_NEAR(back, inner_product(weights, change), 1e-12 * size) << "number " << number;
      const auto value = [&](double e) {
        return inner_product(weights, field_of(moved_points(scene, number, direction, e), s));
      };
      const double e = number < 3 ? 1e-8 : 1e-6, right = (value(e) - value(0)) / e,
                   left = (value(0) - value(-e)) / e;
      if (std::abs(right - left) > 1e-3 * size) continue;  // points that touch come and go
      EXPECT_NEAR(back, 0.5 * (right + left), 1e-5 * size) << "number " << number;
      ++compared;
    }
  }
  kernels::use_kernels(before);
  EXPECT_GT(compared, 14);
}

TEST_P(AlongADirection, AnArrayPointByPointHasTheSameField) {
  const auto [shape, law, pad] = GetParam();
  const Scene scene = testing::pad_scene(shape, law, pad);
  Random random(5);
  const PadState s = testing::random_pad_state(Model(scene), random);
  const std::vector<double> a = field_of(scene, s),
                            b = field_of(
                                moved_points(scene, 0, std::vector<double>(a.size() / 3), 0), s);
  ASSERT_EQ(a.size(), b.size());
  const double size = std::sqrt(inner_product(a, a));
  EXPECT_GT(size, 0);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-12 * size);
}

INSTANTIATE_TEST_SUITE_P(
    All, AlongADirection,
    ::testing::Combine(::testing::Values(PrimitiveShape::sphere, PrimitiveShape::cuboid,
                                         PrimitiveShape::plane, PrimitiveShape::cylinder,
                                         PrimitiveShape::capsule, PrimitiveShape::ellipsoid,
                                         PrimitiveShape::mesh),
                       ::testing::Values(ContactLaw::clamped, ContactLaw::paper),
                       ::testing::Values(Pad::flat, Pad::skewed, Pad::curved)));

}  // namespace
}  // namespace tangere
