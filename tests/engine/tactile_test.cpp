// SPDX-License-Identifier: Apache-2.0
// The tactile kernel of every instruction set against one point at a time; padding and culling must not matter.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "kernels/kernel_table.hpp"
#include "kernels/pair_contact.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::kTactileTile;
using kernels::TactileArgs;
using kernels::Vec3;
using testing::Random;

/// Tiles of random points near a shape; the last one is mostly padding.
struct Field {
  AlignedVector<double> points, force;
  std::vector<double> bounds;
  std::vector<unsigned char> touched;
  TactileArgs args{};

  Field(Random& random, PrimitiveShape shape, int tiles, int real_points) {
    points.assign(std::size_t(tiles) * 3 * kTactileTile, 1e6);
    force.assign(points.size(), 0.0);
    touched.assign(std::size_t(tiles), 0);
    args.shape = shape;
    args.size[0] = 0.02, args.size[1] = 0.03, args.size[2] = 0.01;
    const kernels::Mat3<double> Q = random.rotation();
    for (int i = 0; i < 9; ++i) args.Q[i] = Q.m[i / 3][i % 3];
    const Vec3<double> c = random.vector(0.01), omega = random.vector(2), v = random.vector(0.1);
    args.c[0] = c.x, args.c[1] = c.y, args.c[2] = c.z;
    args.omega[0] = omega.x, args.omega[1] = omega.y, args.omega[2] = omega.z;
    args.v[0] = v.x, args.v[1] = v.y, args.v[2] = v.z;
    args.kn = 30, args.kt = 0.5, args.mu = 0.8, args.damping = 4;
    args.law = ContactLaw::clamped;
    for (int i = 0; i < 3; ++i) args.axes[4 * i] = i == 2 ? -1 : 1;
    for (int t = 0; t < tiles; ++t) {
      const Vec3<double> centre = random.vector(0.02);
      double radius = 0;
      for (int k = 0; k < kTactileTile && t * kTactileTile + k < real_points; ++k) {
        const Vec3<double> offset = random.vector(0.003);
        const double p[3] = {centre.x + offset.x, centre.y + offset.y, centre.z + offset.z};
        for (int i = 0; i < 3; ++i) points[std::size_t((t * 3 + i) * kTactileTile + k)] = p[i];
        radius = std::max(radius, std::sqrt(dot(offset, offset)));
      }
      bounds.insert(bounds.end(), {centre.x, centre.y, centre.z, radius * (1 + 1e-9)});
    }
    args.points = points.data();
    args.bounds = bounds.data();
    args.n_tiles = tiles;
    args.force = force.data();
    args.touched = touched.data();
  }

  [[nodiscard]] Vec3<double> reference(int tile, int k) const {
    const double* p = &points[std::size_t(tile * 3 * kTactileTile + k)];
    const Vec3<double> xi = {p[0], p[kTactileTile], p[2 * kTactileTile]};
    kernels::Mat3<double> Q;
    for (int i = 0; i < 9; ++i) Q.m[i / 3][i % 3] = args.Q[i];
    const kernels::LawParameters<double> law = {args.kn, args.kt, args.mu, args.damping, args.law, 0};
    const Vec3<double> c = {args.c[0], args.c[1], args.c[2]}, w = {args.omega[0], args.omega[1], args.omega[2]},
                       v = {args.v[0], args.v[1], args.v[2]};
    const auto at = args.shape == PrimitiveShape::sphere
                        ? point_contact(kernels::SphereDistance<double>{args.size[0]}, law, Q, c, w, v, xi)
                        : point_contact(kernels::CuboidDistance<double>{{args.size[0], args.size[1], args.size[2]}}, law,
                                        Q, c, w, v, xi);
    return {at.force.x, at.force.y, -at.force.z};
  }
};

class TactileKernel : public ::testing::TestWithParam<PrimitiveShape> {};

TEST_P(TactileKernel, MatchesOnePointAtATimeOnEveryInstructionSet) {
  constexpr int kTiles = 40, kPoints = (kTiles - 1) * kTactileTile + 5;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    AlignedVector<double> fused;
    for (const kernels::KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(table->name);
      Random random(seed);
      Field f(random, GetParam(), kTiles, kPoints);
      // Padding holds NaN here: it must reach no real point.
      for (int k = 5; k < kTactileTile; ++k)
        for (int i = 0; i < 3; ++i)
          f.points[std::size_t(((kTiles - 1) * 3 + i) * kTactileTile + k)] = std::numeric_limits<double>::quiet_NaN();
      table->tactile(f.args);
      double peak = 0;
      for (int n = 0; n < kPoints; ++n) {
        const Vec3<double> expected = f.reference(n / kTactileTile, n % kTactileTile);
        peak = std::max(peak, std::sqrt(dot(expected, expected)));
      }
      ASSERT_GT(peak, 0);
      int touching = 0;
      for (int n = 0; n < kPoints; ++n) {
        const int t = n / kTactileTile, k = n % kTactileTile;
        const Vec3<double> expected = f.reference(t, k);
        const double* got = &f.force[std::size_t(t * 3 * kTactileTile + k)];
        EXPECT_NEAR(got[0], expected.x, 1e-13 * peak);
        EXPECT_NEAR(got[kTactileTile], expected.y, 1e-13 * peak);
        EXPECT_NEAR(got[2 * kTactileTile], expected.z, 1e-13 * peak);
        if (dot(expected, expected) == 0) {
          EXPECT_EQ(got[0], 0);
        } else {
          ++touching;
          EXPECT_EQ(f.touched[std::size_t(t)], 1);
        }
      }
      EXPECT_GT(touching, 50);
      EXPECT_LT(touching, kPoints - 50);
      // Culling off: the same bits.
      Field all = f;
      all.force.assign(all.force.size(), 0.0);
      for (std::size_t t = 0; t < kTiles; ++t) all.bounds[4 * t + 3] = 1e9;
      all.args.points = all.points.data(), all.args.bounds = all.bounds.data(), all.args.force = all.force.data();
      all.args.touched = all.touched.data();
      table->tactile(all.args);
      for (int n = 0; n < kPoints; ++n)
        for (int i = 0; i < 3; ++i) {
          const std::size_t at = std::size_t((n / kTactileTile * 3 + i) * kTactileTile + n % kTactileTile);
          EXPECT_EQ(all.force[at], f.force[at]);
        }
      const std::string name = table->name;
      if (name == "avx512") fused = f.force;
      if (name == "avx2" && !fused.empty()) {
        for (int n = 0; n < kPoints; ++n) {
          const std::size_t at = std::size_t(n / kTactileTile * 3 * kTactileTile + n % kTactileTile);
          EXPECT_EQ(f.force[at], fused[at]);
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, TactileKernel, ::testing::Values(PrimitiveShape::sphere, PrimitiveShape::cuboid));

TEST(Tactile, ForcesOfSeveralBodiesAdd) {
  // A second ball in the same place doubles the field.
  Scene one = testing::rolling_ball(false, 20), two = one;
  two.links.push_back(two.links[1]);
  two.links[2].name = two.links[2].body.name = "twin";
  two.links[2].joint.name = "twin_joint";
  const Model m1(one), m2(two);
  Batch b1(m1, 1), b2(m2, 1);
  std::vector<double> q1 = testing::q_of(b1), q2 = testing::q_of(b2);
  q1[2] = q2[2] = -0.016;
  b1.set_state(0, q1, testing::v_of(b1));
  b2.set_state(0, q2, testing::v_of(b2));
  std::vector<double> f1(1200), f2(1200);
  Readout r1(m1), r2(m2);
  r1.tactile(b1, 0, 0, f1);
  r2.tactile(b2, 0, 0, f2);
  double peak = 0;
  for (std::size_t k = 0; k < f1.size(); ++k) {
    EXPECT_EQ(2 * f1[k], f2[k]);
    peak = std::max(peak, std::abs(f1[k]));
  }
  EXPECT_GT(peak, 0);
}

TEST(Tactile, BodiesReportTheirOwnFrames) {
  // Twists by differences of poses, on a scene with offset and yawed body frames.
  const Model model(testing::two_balls());
  Readout readout(model);
  Batch batch(model, 1);
  std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = 0.3 - 0.1 * double(i % 5);
  const auto poses = [&](double t) {
    std::vector<double> at = q;
    for (std::size_t i = 0; i < 3; ++i) at[i] += t * v[i], at[3 + i] += t * v[3 + i], at[10 + i] += t * v[9 + i];
    for (std::size_t ball = 0; ball < 2; ++ball) {
      const std::size_t p = 6 + 7 * ball, w = 6 + 6 * ball;
      const auto turned = kernels::rotate_by(kernels::Quat<double>{q[p], q[p + 1], q[p + 2], q[p + 3]},
                                             t * Vec3<double>{v[w], v[w + 1], v[w + 2]});
      at[p] = turned.w, at[p + 1] = turned.x, at[p + 2] = turned.y, at[p + 3] = turned.z;
    }
    batch.set_state(0, at, v);
    std::vector<double> pose(21), twist(18);
    readout.bodies(batch, 0, pose, twist);
    return std::pair(pose, twist);
  };
  const double h = 1e-6;
  const auto [now, twist] = poses(0);
  const auto ahead = poses(h).first, behind = poses(-h).first;
  for (std::size_t b = 0; b < 3; ++b) {
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(twist[6 * b + 3 + i], (ahead[7 * b + i] - behind[7 * b + i]) / (2 * h), 1e-9);
    double norm = 0;
    for (std::size_t i = 3; i < 7; ++i) norm += now[7 * b + i] * now[7 * b + i];
    EXPECT_NEAR(norm, 1, 1e-14);
    // ω = 2 q̇ q*, its vector part.
    const auto quat = [&](const std::vector<double>& x) {
      return kernels::Quat<double>{x[7 * b + 3], x[7 * b + 4], x[7 * b + 5], x[7 * b + 6]};
    };
    const auto turn = quat(ahead) * conjugate(quat(behind));
    const double rate[3] = {turn.x / h, turn.y / h, turn.z / h};
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(twist[6 * b + i], rate[i], 1e-8);
  }
  EXPECT_NEAR(now[2], 0.062, 1e-15);  // the plate's body frame sits 2 mm above its joint
}

}  // namespace
}  // namespace tangere
