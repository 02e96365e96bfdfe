// SPDX-License-Identifier: Apache-2.0
// Tests the law of one point: values against explicit formulas, derivatives against dual numbers
// and differences.
#include <gtest/gtest.h>

#include <array>
#include <utility>
#include <vector>

#include "kernels/contact/face_contact.hpp"
#include "kernels/contact/pair_contact.hpp"
#include "kernels/contact/sphere_contact.hpp"
#include "kernels/numbers/dual.hpp"
#include "tests/kernels/contact/product_sums.hpp"
#include "tests/kernels/lift.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

/// Coefficients count per point.
constexpr const double* kByPoint = nullptr;

using namespace kernels;
using D = Dual<double>;
using testing::lift;
using testing::Random;

struct Case {
  ContactLaw law;
  double ramp;
  PrimitiveShape shape;
};

Vec3<double> size_of(PrimitiveShape shape) {
  if (shape == PrimitiveShape::sphere) return {0.02, 0, 0};
  if (shape == PrimitiveShape::cuboid) return {0.025, 0.02, 0.01};
  if (shape == PrimitiveShape::ellipsoid) return {0.03, 0.02, 0.012};
  return {0.02, 0.015, 0};
}

class PairDerivative : public ::testing::TestWithParam<Case> {};

struct State {
  Mat3<double> Q;
  Vec3<double> c, omega, v, xi;
  LawParameters<double> law;
};

/// A point in the shape's own frame that lies `depth` under its surface, on each of its kinds of
/// surface.
Vec3<double> point_under(PrimitiveShape shape, Random& random, double depth) {
  const double around = random.uniform(-3, 3), along = random.uniform(-0.012, 0.012),
               face = random.uniform(0, 1);
  const Vec3<double> radial = {std::cos(around), std::sin(around), 0},
                     z = {0, 0, face < 0.25 ? -1.0 : 1.0};
  switch (shape) {
    case PrimitiveShape::sphere: return (0.02 - depth) * random.direction();
    case PrimitiveShape::cuboid: return {0.025 - depth, along, random.uniform(-0.008, 0.008)};
    case PrimitiveShape::plane: return {along, 10 * along, -depth};
    case PrimitiveShape::cylinder:
      return face < 0.5 ? (0.015 - depth) * z + (1 + along) * 0.01 * radial
                        : (0.02 - depth) * radial + along * Vec3<double>{0, 0, 1};
    case PrimitiveShape::ellipsoid: {
      const Vec3<double> n = random.direction();
      const double h = std::sqrt(9e-4 * n.x * n.x + 4e-4 * n.y * n.y + 1.44e-4 * n.z * n.z);
      return Vec3<double>{9e-4 * n.x / h, 4e-4 * n.y / h, 1.44e-4 * n.z / h} - depth * n;
    }
    case PrimitiveShape::mesh:  // tests/engine/step/mesh_contact_test.cpp
    case PrimitiveShape::capsule: break;
  }
  Vec3<double> end = random.direction();
  end.z = std::abs(end.z);
  return face < 0.5 ? 0.015 * z + (0.02 - depth) * Vec3<double>{end.x, end.y, z.z * end.z}
                    : (0.02 - depth) * radial + along * Vec3<double>{0, 0, 1};
}

/// A point inside the shape that slides slowly or fast, so that both stick and slip occur.
State random_state(Random& random, const Case& test) {
  State s;
  s.Q = random.rotation();
  s.c = random.vector(0.05);
  const double depth = random.uniform(0, 1) < 0.3 ? 5e-6 : 1e-3 * random.uniform(0.1, 1);
  s.xi = s.c + s.Q * point_under(test.shape, random, depth);
  s.omega = random.vector(1);
  s.v = random.vector(random.uniform(0, 1) < 0.5 ? 1e-3 : 0.3);
  s.law = {{random.uniform(10, 1000), random.uniform(0.5, 5), random.uniform(0.1, 1.5),
            random.uniform(0, 20)},
           test.law,
           test.ramp};
  if (test.law == ContactLaw::linear) s.law.damping = random.uniform(0, 0.05);
  return s;
}

template <class N>
PairSums<N> sums(const State& s, const Case& test, const Vec6<double>& epsilon,
                 const Vec6<double>& rate) {
  PairSums<N> out = PairSums<N>::zero();
  // Body 2 displaced by ε in body 1's axes: Q ← Q + [θ]Q, c ← c + ρ + θ × c; W ← W + δW.
  const Mat3<double> turn = skew(epsilon.a) * s.Q;
  Mat3<N> Q;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) Q.m[i][j] = lift<N>(s.Q.m[i][j], turn.m[i][j]);
  const Vec3<N> c = lift<N>(s.c, epsilon.l + cross(epsilon.a, s.c));
  const LawParameters<N> law = {
      {N(s.law.kn), N(s.law.kt), N(s.law.mu), N(s.law.damping)}, s.law.law, s.law.ramp};
  const Vec3<N> xi = lift<N>(s.xi, {0, 0, 0});
  const Vec3<N> omega = lift<N>(s.omega, rate.a), v = lift<N>(s.v, rate.l);
  constexpr bool kDerivatives = std::is_same_v<N, double>;
  with_distance<N>(test.shape, size_of(test.shape), [&](const auto& shape) {
    accumulate<kDerivatives>(out, shape, law, Q, c, omega, v, xi);
  });
  return out;
}

Vec6<double> apply(const Mat3<double> (&m)[2][2], const Vec6<double>& x) {
  return {m[0][0] * x.a + m[0][1] * x.l, m[1][0] * x.a + m[1][1] * x.l};
}

void expect_close(const Vec6<double>& a, const Vec6<double>& b, double scale, double tolerance) {
  const double x[6] = {a.a.x, a.a.y, a.a.z, a.l.x, a.l.y, a.l.z},
               y[6] = {b.a.x, b.a.y, b.a.z, b.l.x, b.l.y, b.l.z};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(x[i], y[i], tolerance * scale) << "component " << i;
}

TEST_P(PairDerivative, MatchesDualNumbers) {
  Random random(21);
  int slipping = 0, sticking = 0;
  for (int k = 0; k < 400; ++k) {
    const State s = random_state(random, GetParam());
    const Vec6<double> zero = zero6<double>(), e = random.motion(1);
    const PairSums<double> value = sums<double>(s, GetParam(), zero, zero);
    const Vec6<double> by_pose = apply(value.k, e), by_rate = apply(value.d, e);
    const double pose_scale = 1e-30 + std::sqrt(dot(by_pose, by_pose)),
                 rate_scale = 1e-30 + std::sqrt(dot(by_rate, by_rate));
    const Vec6<D> pose = sums<D>(s, GetParam(), e, zero).wrench,
                  rate = sums<D>(s, GetParam(), zero, e).wrench;
    const auto epsilon = [](const Vec6<D>& w) {
      return Vec6<double>{{w.a.x.epsilon, w.a.y.epsilon, w.a.z.epsilon},
                          {w.l.x.epsilon, w.l.y.epsilon, w.l.z.epsilon}};
    };
    expect_close(by_pose, epsilon(pose), pose_scale, 1e-11);
    expect_close(by_rate, epsilon(rate), rate_scale, 1e-11);
    const PointContact<double> p =
        with_distance<double>(GetParam().shape, size_of(GetParam().shape), [&](const auto& shape) {
          return point_contact(shape, s.law, s.Q, s.c, s.omega, s.v, s.xi);
        });
    ASSERT_LT(p.d, 0);
    (p.tangential.slip > 0 ? slipping : sticking)++;
  }
  EXPECT_GT(slipping, 20);
  EXPECT_GT(sticking, 20);
}

TEST_P(PairDerivative, MatchesCentralDifferences) {
  Random random(22);
  int compared = 0;
  for (int k = 0; k < 200; ++k) {
    const State s = random_state(random, GetParam());
    const Vec6<double> e = random.motion(1), zero = zero6<double>();
    const Vec6<double> analytic = apply(sums<double>(s, GetParam(), zero, zero).k, e);
    const double h = 1e-8;
    const auto moved = [&](double step) {
      State t = s;
      const Vec3<double> turn = step * e.a;
      t.Q = rotation_exp(turn, rotation_series(turn)) * s.Q;
      t.c = rotation_exp(turn, rotation_series(turn)) * s.c + step * e.l;
      return sums<double>(t, GetParam(), zero, zero).wrench;
    };
    const Vec6<double> ahead = moved(h), behind = moved(-h);
    const Vec6<double> difference = {(0.5 / h) * (ahead.a - behind.a),
                                     (0.5 / h) * (ahead.l - behind.l)};
    const Vec6<double> one_side = {(1 / h) * (ahead.a - moved(0).a),
                                   (1 / h) * (ahead.l - moved(0).l)};
    const Vec6<double> bend = one_side - difference;
    const double scale = std::sqrt(dot(analytic, analytic));
    if (std::sqrt(dot(bend, bend)) > 1e-4 * scale) continue;  // a kink within ±h
    expect_close(analytic, difference, scale, 2e-6);
    ++compared;
  }
  EXPECT_GT(compared, 150);
}

/// Every law for the first `shapes` shapes, of which spheres come first.
std::vector<Case> laws_and_shapes(int shapes) {
  std::vector<Case> cases;
  for (int shape = 0; shape < shapes; ++shape)
    for (const auto& [law, ramp] : {std::pair{ContactLaw::clamped, 0.0},
                                    {ContactLaw::paper, 0.0},
                                    {ContactLaw::linear, 1e-5},
                                    {ContactLaw::linear, 0.0}})
      cases.push_back({law, ramp, static_cast<PrimitiveShape>(shape)});
  return cases;
}
INSTANTIATE_TEST_SUITE_P(
    LawsAndShapes, PairDerivative,
    ::testing::ValuesIn(laws_and_shapes(static_cast<int>(PrimitiveShape::mesh))));

TEST(ContactLaw, ValuesAreTheFormulas) {
  const auto force = [](ContactLaw law, double ramp, double d, double rate, double damping) {
    return normal_force(LawParameters<double>{{100, 1, 0.5, damping}, law, ramp}, d, rate).force;
  };
  EXPECT_DOUBLE_EQ(force(ContactLaw::clamped, 0, -1e-3, -0.1, 50), (-100 + 50 * -0.1) * -1e-3);
  EXPECT_EQ(force(ContactLaw::clamped, 0, -1e-3, 3, 50), 0);                // would pull
  EXPECT_DOUBLE_EQ(force(ContactLaw::paper, 0, -1e-3, 3, 50), 50 * -1e-3);  // does
  EXPECT_DOUBLE_EQ(force(ContactLaw::linear, 0, -1e-3, -0.1, 0.05), 0.1 + 0.005);
  EXPECT_DOUBLE_EQ(force(ContactLaw::linear, 0, -1e-3, 3, 0.05), 0.1 - 0.15);  // pulls
  EXPECT_EQ(force(ContactLaw::linear, 1e-5, -1e-3, 3, 0.05), 0);               // does not
  EXPECT_DOUBLE_EQ(force(ContactLaw::linear, 1e-5, -1e-3, -0.1, 0.05), 0.1 + 0.005);
  EXPECT_DOUBLE_EQ(force(ContactLaw::linear, 1e-5, -5e-6, -0.1, 0.05), 5e-4 + 0.5 * 0.005);
  for (ContactLaw law : {ContactLaw::clamped, ContactLaw::paper, ContactLaw::linear}) {
    EXPECT_EQ(force(law, 1e-5, 0, -1, 1), 0);
    EXPECT_EQ(force(law, 1e-5, 1e-9, -1, 1), 0);
  }
}

/// Where it pushes and where it pulls. The bound of friction is that of the spring alone.
TEST(ContactLaw, CotangentsOfThePublishedGroundLawAreItsDerivatives) {
  Random random(31);
  int pulls = 0;
  for (int k = 0; k < 200; ++k) {
    const double kn = random.uniform(10, 1e3), c = random.uniform(0, 2),
                 d = -random.uniform(0, 1e-3), rate = random.uniform(-1, 1),
                 of_force = random.uniform(-1, 1), of_bound = random.uniform(-1, 1);
    const LawParameters<double> law = {{kn, 1, 0.5, c}, ContactLaw::linear, 0};
    const NormalForce<double> at = normal_force(law, d, rate);
    Coefficients<double> out{};
    pull_back_normal_force(law, d, rate, at, of_force, of_bound, out);
    const auto derivative = [&](double by_kn, double by_c, double by_d, double by_rate) {
      const LawParameters<D> along = {
          {D(kn, by_kn), D(1.0), D(0.5), D(c, by_c)}, law.law, law.ramp};
      const NormalForce<D> n = normal_force(along, D(d, by_d), D(rate, by_rate));
      return std::pair{n.force.epsilon, n.bound.epsilon};
    };
    const auto [force_kn, bound_kn] = derivative(1, 0, 0, 0);
    const auto [force_c, bound_c] = derivative(0, 1, 0, 0);
    const auto [force_d, bound_d] = derivative(0, 0, 1, 0);
    const auto [force_rate, bound_rate] = derivative(0, 0, 0, 1);
    EXPECT_NEAR(out.kn, of_force * force_kn + of_bound * bound_kn, 1e-15);
    EXPECT_NEAR(out.damping, of_force * force_c + of_bound * bound_c, 1e-15);
    EXPECT_EQ(at.d_slope, force_d);
    EXPECT_EQ(at.rate_slope, force_rate);
    EXPECT_EQ(at.bound_d, bound_d);
    EXPECT_EQ(at.bound_rate, bound_rate);
    EXPECT_DOUBLE_EQ(at.bound, -kn * d);
    if (at.force < 0) ++pulls;
  }
  EXPECT_GT(pulls, 20);
}

TEST(ContactLaw, FrictionNeverExceedsItsBoundAndNeverDividesByZero) {
  Random random(23);
  for (int k = 0; k < 2000; ++k) {
    const LawParameters<double> law = {
        {random.uniform(1, 1e6), random.uniform(0, 1e3), random.uniform(0, 3), 0},
        ContactLaw::clamped,
        0};
    const NormalForce<double> normal = normal_force(law, -random.uniform(0, 1e-2), 0.0);
    for (double speed : {0.0, 1e-300, 1e-30, 1e-3, 10.0}) {
      const Vec3<double> vt = speed * random.direction();
      const Friction<double> f = friction(law, normal, vt);
      const Vec3<double> force = f.scale * vt;
      EXPECT_TRUE(std::isfinite(f.scale));
      EXPECT_LE(std::sqrt(dot(force, force)), law.mu * normal.force * (1 + 1e-12));
      if (speed == 0) {
        EXPECT_EQ(f.scale, law.kt);  // the stick derivative at rest
      }
    }
  }
}

TEST(ContactLaw, FrictionBySecantHasTheSameForceAndAConstantScale) {
  Random random(29);
  int slips = 0;
  for (int k = 0; k < 200; ++k) {
    LawParameters<double> law = {
        {random.uniform(100, 1e4), random.uniform(1, 100), random.uniform(0.1, 2), 10},
        ContactLaw::clamped,
        0};
    const Vec3<double> omega = random.vector(1), v = random.vector(1), xi = {0, 0, 0};
    const auto sums = [&](double tangent) {
      law.friction_tangent = tangent;
      PairSums<double> s = PairSums<double>::zero();
      accumulate<true>(s, SphereDistance<double>{0.02}, law, diagonal(1.0),
                       Vec3<double>{0, 0, 0.019}, omega, v, xi);
      return s;
    };
    const PairSums<double> exact = sums(1), secant = sums(0);
    for (int i = 0; i < 3; ++i) EXPECT_EQ((&exact.wrench.l.x)[i], (&secant.wrench.l.x)[i]);
    // The normal is z. For a slipping point this is the force across the normal by the velocity
    // across it. In the derivative it is -s (I - t tᵀ), by the secant -s I.
    const auto block = [](const PairSums<double>& s) {
      return std::array{s.d[1][1].m[0][0], s.d[1][1].m[0][1], s.d[1][1].m[1][1]};
    };
    const std::array<double, 3> e = block(exact), s = block(secant);
    EXPECT_NEAR(s[0], s[2], 1e-12 * std::abs(s[0]));
    EXPECT_NEAR(s[1], 0, 1e-12 * std::abs(s[0]));
    if (std::abs(s[0]) < law.kt * (1 - 1e-9)) {  // slips
      ++slips;
      EXPECT_NEAR(e[0] + e[2], s[0], 1e-9 * std::abs(s[0])) << "one of two directions is free";
      EXPECT_NEAR(e[0] * e[2] - e[1] * e[1], 0, 1e-9 * s[0] * s[0]);
    } else {
      EXPECT_NEAR(e[0], s[0], 1e-12 * std::abs(s[0]));
    }
  }
  EXPECT_GT(slips, 50);
}

TEST(ContactLaw, NoContactIsExactlyZero) {
  const LawParameters<double> law = {{10, 1, 1, 1}, ContactLaw::clamped, 0};
  PairSums<double> s = PairSums<double>::zero();
  accumulate<true>(s, SphereDistance<double>{0.02}, law, diagonal(1.0), Vec3<double>{0, 0, 0.03},
                   Vec3<double>{1, 2, 3}, Vec3<double>{1, 1, 1}, Vec3<double>{0, 0, 0});
  EXPECT_EQ(dot(s.wrench, s.wrench), 0);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) EXPECT_EQ(s.k[i][j].m[r][c], 0);
}

TEST(GroundContact, DerivativesMatchDualNumbersForPointsAndSpheres) {
  Random random(24);
  for (double radius : {0.0, 0.02})
    for (ContactLaw which : {ContactLaw::linear, ContactLaw::clamped, ContactLaw::paper})
      for (int k = 0; k < 300; ++k) {
        const Mat3<double> R = random.rotation();
        const Vec3<double> normal = random.direction(), centre = random.vector(0.03);
        const double depth = 1e-3 * random.uniform(0.01, 1);
        const double height = radius - depth - dot(transposed_times(R, normal), centre);
        const Vec6<double> V = {random.vector(2), random.vector(0.05)}, e = random.motion(1),
                           w = random.motion(1);
        const auto evaluate = [&]<class N>(N, bool pose, bool rate) {
          const Mat3<double> turn = R * skew(e.a);
          Mat3<N> Rn;
          for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) Rn.m[i][j] = lift<N>(R.m[i][j], pose ? turn.m[i][j] : 0);
          const Vec3<N> m = transposed_times(Rn, lift<N>(normal, {0, 0, 0}));
          const N at = lift<N>(height, pose ? dot(normal, R * e.l) : 0);
          const Vec3<double> none = {0, 0, 0};
          const Vec6<N> Vn = {lift<N>(V.a, rate ? w.a : none), lift<N>(V.l, rate ? w.l : none)};
          const LawParameters<N> law = {{N(200.0), N(2.0), N(0.8), N(0.3)}, which, 1e-5};
          PairSums<N> s = PairSums<N>::zero();
          accumulate_ground<std::is_same_v<N, double>>(s, law, m, at, Vn, lift<N>(centre, none),
                                                       N(radius));
          return s;
        };
        const PairSums<double> s = evaluate(0.0, false, false);
        // ε = -δ₁, δW = -δV₁.
        const Vec6<double> by_pose = -apply(s.k, e), by_rate = -apply(s.d, w);
        const Vec6<D> pose = evaluate(D(0.0), true, false).wrench,
                      rate = evaluate(D(0.0), false, true).wrench;
        const auto epsilon = [](const Vec6<D>& x) {
          return Vec6<double>{{x.a.x.epsilon, x.a.y.epsilon, x.a.z.epsilon},
                              {x.l.x.epsilon, x.l.y.epsilon, x.l.z.epsilon}};
        };
        expect_close(by_pose, epsilon(pose), 1e-30 + std::sqrt(dot(by_pose, by_pose)), 1e-11);
        expect_close(by_rate, epsilon(rate), 1e-30 + std::sqrt(dot(by_rate, by_rate)), 1e-11);
      }
}

/// Compares sums in products, chunk by chunk, with the general sums of the same points.
template <class Motion>
void expect_same_sums(const Motion& motion, const State& s, const std::vector<Vec3<double>>& xi,
                      const PairSums<double>& general) {
  PairSums<double> finished = PairSums<double>::zero(), values = finished;
  typename Motion::Sums sums, forces;
  clear<true>(sums);
  clear<false>(forces);
  PointChunk<typename Motion::Point> chunk;
  for (std::size_t k = 0; k < xi.size(); k += 6) {
    fill_chunk<true>(motion, s.law, &xi[k], kByPoint, 6, chunk);
    add_chunk<true>(sums, chunk);
    fill_chunk<false>(motion, s.law, &xi[k], kByPoint, 6, chunk);
    add_chunk<false>(forces, chunk);
  }
  const Vec6<double> W = {s.omega, s.v};
  if constexpr (std::is_same_v<Motion, SphereMotion<double>>) {
    add_finished<true>(motion, W, sums, finished);
    add_finished<false>(motion, W, forces, values);
  } else {
    add_finished<true>(W, sums, finished);
    add_finished<false>(W, forces, values);
  }
  testing::expect_finished_sums(finished, values, general, 2e-12);
}

class ProductSumsOf : public PairDerivative {};
TEST_P(ProductSumsOf, PointsAreTheGeneralSums) {
  const Case test = GetParam();
  Random random(7);
  for (int trial = 0; trial < 200; ++trial) {
    const State s = random_state(random, test);
    with_distance<double>(
        test.shape, size_of(test.shape),
        [&]<template <class> class Shape>(const Shape<double>& shape) {
          PairSums<double> general = PairSums<double>::zero();
          std::vector<Vec3<double>> xi;
          for (int k = 0; k < 12; ++k) {
            // Most points are inside, some outside: the state's own point first, then others under
            // the surface.
            const double depth = 1e-3 * random.uniform(-0.3, 1);
            xi.push_back(k == 0 ? s.xi : s.c + s.Q * point_under(test.shape, random, depth));
            accumulate<true>(general, shape, s.law, s.Q, s.c, s.omega, s.v, xi.back());
          }
          if constexpr (Shape<double>::kSums == PointSumForm::about_centre) {
            expect_same_sums(sphere_motion(s.c, {s.omega, s.v}, shape.radius), s, xi, general);
          } else if constexpr (Shape<double>::kSums == PointSumForm::faces) {
            expect_same_sums(FaceMotion<Shape, double>{{s.Q, s.c}, {s.omega, s.v}, shape}, s, xi,
                             general);
          }
        });
  }
}

INSTANTIATE_TEST_SUITE_P(Laws, ProductSumsOf, ::testing::ValuesIn(laws_and_shapes(4)));

}  // namespace
}  // namespace tangere
