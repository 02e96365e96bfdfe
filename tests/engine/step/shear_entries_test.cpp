// SPDX-License-Identifier: Apache-2.0
// Tests entries of shear states in vectors: the kernels against the law point by point, on every
// instruction set, and environments of a batch, of which some touch and some do not, against the
// same on their own.
#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "engine/model/compile.hpp"
#include "engine/step/shear_lane.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"
#include "tests/sanitized.hpp"

namespace tangere {
namespace {

using kernels::KernelTable;
using kernels::kGroup;
using kernels::LinkPose;
using kernels::ShearSpringContact;
using kernels::ShearSpringPoints;
using kernels::ShearSpringTouch;
using testing::link;

/// A box of 25 points a side on a plate with a skin of 81 points, and a brick on the ground, all
/// with springs, on a slope of 15°.
Scene skin_and_brick() {
  Scene s;
  s.name = "skin_and_brick";
  s.gravity = {2.54, 0, -9.47};
  s.ground = GroundDescription{{0, 0, -0.02}, {0, 0, 1}};
  s.links = {link("plate", JointType::fixed, {0, 0, -0.01},
                  CuboidShape{{0.2, 0.2, 0.02}, {2, 2, 2}}, 1000),
             link("box", JointType::free, {0, 0, 0.0099},
                  CuboidShape{{0.06, 0.06, 0.02}, {5, 5, 2}}, 1000),
             link("brick", JointType::free, {0.3, 0, -0.0101},
                  CuboidShape{{0.05, 0.05, 0.02}, {3, 3, 2}}, 1000)};
  s.pair_contacts.push_back(
      {"box", "plate", {800, 1, 0.4, 5e3, 300}, ContactLaw::clamped, 1e-5, {}});
  s.ground_contacts.push_back({"brick", {800, 1, 0.4, 2, 300}, ContactLaw::linear, 1e-5, {}});
  TactileDescription t;
  t.name = t.body = "plate";
  t.coefficients = {50, 0.05, 0.4, 50, 20};
  t.array = {{-0.035, -0.035, 0.01}, {0.035, 0.035, 0.01}, {1, 0, 0}, {0, 1, 0}, 9, 9};
  s.sensors.push_back(t);
  return s;
}

void expect_same(const ShearState& one, const ShearState& other) {
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_EQ(one[k].point, other[k].point);
    EXPECT_EQ(std::memcmp(one[k].s, other[k].s, sizeof(one[k].s)), 0) << "point " << one[k].point;
  }
}

TEST(ShearEntries, AnEnvironmentHasThemFromAnyNeighbours) {
  const Model model(skin_and_brick());
  Stepper stepper(model);
  constexpr int kEnvironments = 21, kSteps = kSanitized ? 15 : 60;
  Batch many(model, kEnvironments);
  std::vector<Batch> alone;
  for (int e = 0; e < kEnvironments; ++e) {
    std::vector<double> q = testing::q_of(many, e), v = testing::v_of(many, e);
    q[2] += 1e-3 * (e % 4) + (e % 7 == 0 ? 0.05 : 0);  // of every seven one is far away
    q[9] += 1e-3 * (e % 5);
    v[0] = 0.02 * (e % 3), v[4] = 0.5 * (e % 6);
    many.set_state(e, q, v);
    alone.emplace_back(model, 1).set_state(0, q, v);
  }
  std::set<std::size_t> sizes;
  for (int t = 0; t < kSteps; ++t) {
    stepper.step(many, {});
    for (int e = 0; e < kEnvironments; ++e) {
      stepper.step(alone[std::size_t(e)], {});
      ASSERT_EQ(testing::q_of(many, e), testing::q_of(alone[std::size_t(e)]))
          << e << ", step " << t;
      expect_same(many.shear_state(e), alone[std::size_t(e)].shear_state(0));
      sizes.insert(many.shear_state(e).size());
    }
  }
  EXPECT_EQ(*sizes.begin(), 0U);
  EXPECT_GT(*sizes.rbegin(), 80U) << "boxes, skins and bricks touch";
  EXPECT_GT(sizes.size(), kSanitized ? 3U : 10U) << "parts of them touch";
}

/// One contact of the skin at two poses of the box, and a shear state between them.
struct SkinStep {
  std::shared_ptr<const CompiledModel> m = compile(skin_and_brick());
  const ShearSpringContact& of = contact(*m);
  TouchingSensorPoints sensor_points{*m};
  ShearSpringTouch start = touch(0, 0), end = touch(2e-4, 0.01);

  /// The skin's against the box.
  static const ShearSpringContact& contact(const CompiledModel& m) {
    for (const ShearSpringContact& c : m.shear_springs)
      if (c.sensor >= 0 && m.scene.links[std::size_t(c.contact.body2)].name == "box") return c;
    throw InputError("the scene has no sensor with springs against the box");
  }
  /// With the box moved along x [m] and tilted [rad].
  [[nodiscard]] ShearSpringTouch touch(double x, double tilt) const {
    const auto still = kernels::zero6<double>();
    EXPECT_LT(of.contact.link1, 0) << "the plate is the world's";
    const LinkPose<double> world = {{kernels::diagonal(1.0), kernels::zero3<double>()}, still};
    const double c = std::cos(tilt), s = std::sin(tilt);
    const LinkPose<double> box = {{{{{c, 0, s}, {0, 1, 0}, {-s, 0, c}}}, {x, 0, 0.0098}},
                                  {{0.1, 0.2, 0.3}, {0.02, 0.01, -0.03}}};
    return touch_between(of, world, box, [](const kernels::Parameter& p) { return p.value; });
  }
  /// Entries of the points that `keeps`(k) keeps.
  template <class Keeps>
  [[nodiscard]] ShearState memory(const Keeps& keeps) const {
    testing::Random random(7);
    ShearState out = {{of.first - 1, {1, 1, 1}}};  // of another contact
    for (int k = 0; k < of.contact.n_points; ++k)
      if (keeps(k))
        out.push_back({of.first + k,
                       {1e-4 * random.normal(), 1e-4 * random.normal(), 1e-6 * random.normal()}});
    out.push_back({of.first + of.contact.n_points, {1, 1, 1}});
    return out;
  }
};

/// Anchors and entries of a step from the rows of elastic displacements that the kernels of
/// readings take.
void expect_entries_of_rows(const KernelTable& table, SkinStep& step, const ShearState& memory) {
  const CompiledSensor& sensor = step.m->sensors[0];
  const ShearSpringPoints points = step.sensor_points.find(sensor, table, step.end);
  ASSERT_GT(points.count, 40) << table.name;
  const int* const index = step.sensor_points.index();
  for (int k = 0; k < points.count; ++k)
    for (int c = 0; c < 3; ++c)
      ASSERT_EQ(points.places[c * points.stride + k], step.of.contact.points[3 * index[k] + c]);
  std::size_t next = 0;
  shear_of_points(memory, step.of, index, points.count, points.stride,
                  points.anchors + 3 * points.stride, next);
  table.recall(step.start, points);
  const std::size_t vectors = std::size_t((points.count + kGroup - 1) / kGroup * kGroup);
  AlignedVector<double> s(4 * std::size_t(points.stride));
  table.advance(step.end, points, s.data(), nullptr);
  ShearState expected;
  for (int k = 0; k < points.count; ++k)
    if (s[std::size_t(3 * points.stride + k)] > 0)
      expected.push_back({step.of.first + index[k],
                          {s[std::size_t(k)], s[std::size_t(points.stride + k)],
                           s[std::size_t(2 * points.stride + k)]}});

  const kernels::ShearEntries entries = {memory.data() + 1, memory.data() + memory.size()};
  std::vector<double> anchors(7 * vectors);
  const auto copy_anchors = [&] {
    for (std::size_t i = 0; i < 7; ++i)
      std::copy_n(points.anchors + i * std::size_t(points.stride), vectors, &anchors[i * vectors]);
    return anchors;
  };
  const std::vector<double> from_rows = copy_anchors();
  const kernels::ShearEntries left = table.recall_entries(step.start, points, index, entries);
  EXPECT_EQ(copy_anchors(), from_rows) << table.name;
  EXPECT_LE(left.at, entries.end);

  for (const bool with_anchors : {true, false}) {
    ShearState after(std::size_t(points.count) + kGroup);
    kernels::ShearUpdate update = {
        with_anchors ? nullptr : &step.start, &step.end, points, index, entries, after.data()};
    table.advance_entries(update);
    after.resize(std::size_t(update.after - after.data()));
    SCOPED_TRACE(table.name);
    expect_same(expected, after);
  }
}

TEST(ShearEntries, AreThoseOfTheLawPointByPoint) {
  SkinStep step;
  for (const KernelTable* table : kernels::available_kernels()) {
    expect_entries_of_rows(*table, step, step.memory([](int) { return true; }));
    expect_entries_of_rows(*table, step, step.memory([](int) { return false; }));
    expect_entries_of_rows(*table, step, step.memory([](int k) { return k % 3 != 1; }));
    expect_entries_of_rows(*table, step, step.memory([](int k) { return k > 20 && k != 47; }));
  }
}

}  // namespace
}  // namespace tangere
