// SPDX-License-Identifier: Apache-2.0
// Tests the distance to an ellipsoid against bisection in long double and a search over the
// surface; derivatives against dual numbers; limits; every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "kernels/numbers/dual.hpp"
#include "tests/kernels/lane_probe.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using namespace kernels;
using D = Dual<double>;
using Real = long double;
using testing::Random;
using V = Vec3<double>;
using Ellipsoid = EllipsoidDistance<double>;

double length(const V& a) { return std::sqrt(dot(a, a)); }
double longest(const V& a) { return std::max({a.x, a.y, a.z}); }
double shortest(const V& a) { return std::min({a.x, a.y, a.z}); }

/// Semi-axes that differ by a factor of up to 100; some of them are equal.
V random_axes(Random& random) {
  double a[3];
  for (double& x : a) x = std::pow(10, random.uniform(-2, 0));
  const int alike = random.integer(0, 5);
  if (alike < 3) a[alike] = a[(alike + 1) % 3];
  return {a[0], a[1], a[2]};
}

/// The point at a fraction of the way along the ray through a random point of the surface.
V along_ray(const V& a, double fraction, Random& random) {
  const V s = random.direction();
  return {fraction * a.x * s.x, fraction * a.y * s.y, fraction * a.z * s.z};
}

/// Does 200 bisections of the equation at the head of ellipsoid.hpp. On the middle plane of the
/// shortest axis there is no root; the other components then determine the nearest point's
/// component along that axis.
Real exact_distance(const V& axes, const V& y) {
  const Real a[3] = {axes.x, axes.y, axes.z}, p[3] = {std::abs(y.x), std::abs(y.y), std::abs(y.z)};
  const Real c = std::min({a[0], a[1], a[2]});
  const auto divisor = [&](int i, Real w) { return w + (a[i] - c) * (a[i] + c); };
  const auto sum = [&](Real w) {
    Real s = 0;
    for (int i = 0; i < 3; ++i) s += std::pow(a[i] * p[i] / divisor(i, w), Real(2));
    return s;
  };
  Real low = 0, high = c * c, inside = 0;
  for (int i = 0; i < 3; ++i) high += a[i] * p[i], inside += std::pow(p[i] / a[i], Real(2));
  for (int k = 0; k < 300; ++k) {
    const Real middle = k < 200 && low > 0 ? std::sqrt(low * high) : (low + high) / 2;
    (sum(middle) > 1 ? low : high) = middle;
  }
  Real x[3], on = 0, square = 0;
  for (int i = 0; i < 3; ++i) x[i] = a[i] * a[i] * p[i] / std::max(divisor(i, high), Real(1e-300));
  for (int i = 0; i < 3; ++i) on += std::pow(x[i] / a[i], Real(2));
  if (on < 1 - Real(1e-9))
    *std::find_if(std::begin(x), std::end(x), [&](Real& xi) { return a[&xi - x] == c; }) =
        c * std::sqrt(1 - on);
  for (int i = 0; i < 3; ++i) square += (p[i] - x[i]) * (p[i] - x[i]);
  return inside < 1 ? -std::sqrt(square) : std::sqrt(square);
}

/// A point deep inside, near the surface, outside, or on a plane of symmetry.
V random_place(const V& a, Random& random) {
  V y = along_ray(
      a, random.uniform(0, 1) < 0.3 ? 1 - 1e-3 * random.uniform(0, 1) : random.uniform(0, 2),
      random);
  const int plane = random.integer(0, 8);
  if (plane < 3) (&y.x)[plane] *= random.integer(0, 1) == 0 ? 0 : 1e-9;
  return y;
}

TEST(Ellipsoid, IsTheDistanceToTheSurface) {
  Random random(41);
  for (int k = 0; k < 5000; ++k) {
    const V a = random_axes(random), y = random_place(a, random);
    SCOPED_TRACE(::testing::Message() << "axes " << a.x << ' ' << a.y << ' ' << a.z << ", at "
                                      << y.x << ' ' << y.y << ' ' << y.z);
    const Distance<double> at = Ellipsoid{a}.evaluate(y);
    EXPECT_NEAR(at.d, static_cast<double>(exact_distance(a, y)), 2e-15 * longest(a));
    EXPECT_NEAR(dot(at.n, at.n), 1, 2e-15);
    const V x = y - at.d * at.n;
    const double outward =
        (std::hypot(x.x / a.x, x.y / a.y, x.z / a.z) - 1) * shortest(a) / longest(a);
    EXPECT_NEAR(outward, 0, 1e-13);  // the nearest point lies on the surface
  }
}

TEST(Ellipsoid, NoPointOfTheSurfaceIsNearer) {
  Random random(42);
  int found = 0;
  for (int k = 0; k < 60; ++k) {
    const V a = random_axes(random), y = random_place(a, random);
    const double d = std::abs(Ellipsoid{a}.evaluate(y).d);
    double least = INFINITY;
    V best = {0, 0, 1};
    for (int i = 0; i < 6000; ++i) {  // at random, then nearer and nearer to the best
      const double spread = i < 2000 ? 2 : std::pow(0.5, (i - 2000) / 120);
      const V s = best + random.vector(spread);
      const V u = (1 / length(s)) * s;
      const double to = length(y - V{a.x * u.x, a.y * u.y, a.z * u.z});
      if (to < least) least = to, best = u;
    }
    EXPECT_GE(least, d * (1 - 1e-12));
    found += least <= d + 1e-6 * longest(a);
  }
  EXPECT_GT(found, 45);  // of 60; a search may end at another of the surface's near places
}

TEST(Ellipsoid, ABallIsASphere) {
  Random random(43);
  for (int k = 0; k < 500; ++k) {
    const double r = random.uniform(0.01, 1);
    const V y = random.uniform(0.2, 2) * r * random.direction();
    double curvature = 0;
    const Distance<double> sphere = SphereDistance<double>{r}.evaluate(y, curvature),
                           at = Ellipsoid{{r, r, r}}.evaluate(y);
    EXPECT_NEAR(at.d, sphere.d, 1e-15 * r);
    EXPECT_LT(length(at.n - sphere.n), 2e-15);
    const Mat3<double> H = Ellipsoid{{r, r, r}}.hessian(at);
    const V e = random.direction(), expected = curvature * (e - dot(at.n, e) * at.n);
    EXPECT_LT(length(H * e - expected), 1e-13 * curvature);
  }
}

TEST(Ellipsoid, GradientHessianAndSizesMatchDualNumbers) {
  Random random(44);
  int compared = 0;
  for (int k = 0; k < 3000; ++k) {
    const V a = random_axes(random), y = along_ray(a, random.uniform(0.6, 1.5), random),
            e = random.vector(1), grow = {a.x * random.normal(), a.y * random.normal(), 0};
    const Ellipsoid shape{a};
    const Distance<double> at = shape.evaluate(y);
    const Mat3<double> H = shape.hessian(at);
    const double bend = length(H * e) + 1 / longest(a);
    if (at.d < -0.2 * shortest(a) * shortest(a) / longest(a))
      continue;  // near a centre of curvature
    ++compared;
    const EllipsoidDistance<D> moved{{D(a.x), D(a.y), D(a.z)}};
    const Distance<D> by_place = moved.evaluate(Vec3<D>{{y.x, e.x}, {y.y, e.y}, {y.z, e.z}});
    EXPECT_NEAR(by_place.d.epsilon, dot(at.n, e), 1e-11);
    const V turn = {by_place.n.x.epsilon, by_place.n.y.epsilon, by_place.n.z.epsilon};
    EXPECT_LT(length(turn - H * e), 1e-10 * bend);
    EXPECT_LT(length(H * at.n), 1e-12 * bend);
    // A size changes d and n as if the shape moved: by the transpose of size_share().
    V shift = {0, 0, 0};
    for (int c = 0; c < 3; ++c) {
      V unit = {0, 0, 0};
      (&unit.x)[c] = 1;
      (&shift.x)[c] = dot(shape.size_share(y, at.n, unit), grow);
    }
    const EllipsoidDistance<D> grown{{{a.x, grow.x}, {a.y, grow.y}, {a.z, grow.z}}};
    const Distance<D> by_size = grown.evaluate(Vec3<D>{D(y.x), D(y.y), D(y.z)});
    EXPECT_NEAR(by_size.d.epsilon, -dot(at.n, shift), 1e-11);
    const V turned = {by_size.n.x.epsilon, by_size.n.y.epsilon, by_size.n.z.epsilon};
    EXPECT_LT(length(turned + H * shift), 1e-9 * (1 + length(H * shift)));
  }
  EXPECT_GT(compared, 1000);
}

TEST(Ellipsoid, TheMiddleAndFarAwayAreDefined) {
  const V all[] = {{1, 1, 1}, {1, 0.01, 0.01}, {1, 1, 0.01}, {0.5, 1, 0.2}, {0.2, 1, 0.5}};
  for (const V& a : all) {
    const Distance<double> centre = Ellipsoid{a}.evaluate({0, 0, 0});
    EXPECT_NEAR(centre.d, -shortest(a), 1e-15);
    EXPECT_NEAR(dot(centre.n, centre.n), 1, 1e-15);
    for (const V& y :
         {V{0, 0, 0}, V{0.3, 0, 0}, V{0, 0.3, 0}, V{1e-300, 0, 1e-300}, V{0, 0, 0.15}}) {
      const Distance<double> at = Ellipsoid{a}.evaluate(y);
      const Mat3<double> H = Ellipsoid{a}.hessian(at);
      for (const auto& row : H.m)
        for (const double x : row) EXPECT_TRUE(std::isfinite(x));
      EXPECT_NEAR(at.d, static_cast<double>(exact_distance(a, y)), 2e-15 * longest(a));
    }
    const Distance<double> far = Ellipsoid{a}.evaluate({1e6, 1e6, -1e6});
    EXPECT_NEAR(far.d, 1e6 * std::sqrt(3.0), 2);
  }
  EXPECT_EQ(Ellipsoid({0.5, 1, 0.2}).evaluate({0.1, 0, 0}).n.y, 0);  // symmetric to the last digit
}

/// Culling never removes what is near. What it keeps is near the box or the ellipsoid around it.
TEST(Ellipsoid, NothingNearIsCulled) {
  Random random(45);
  int out = 0;
  for (int k = 0; k < 20000; ++k) {
    const V a = random_axes(random);
    const double m = std::pow(10, random.uniform(-4, 0.5));
    const V foot = along_ray(a, 1, random);
    const V y = foot + (m * random.uniform(-1, 3)) * Ellipsoid{a}.evaluate(foot).n;
    const double d = Ellipsoid{a}.evaluate(y).d;
    if (d < m) {
      EXPECT_TRUE(nearer_than(Ellipsoid{a}, y, m)) << d << " nearer than " << m;
    } else {
      out += !nearer_than(Ellipsoid{a}, y, m);
    }
  }
  EXPECT_GT(out, 3000);
}

/// Compares lanes of every instruction set, and lanes alone, with plain double. AVX2 and AVX-512
/// agree bit for bit. NaN stays in its lane.
TEST(Ellipsoid, LanesAgreeOnEveryInstructionSet) {
  Random random(46);
  for (int k = 0; k < 200; ++k) {
    const V a = random_axes(random);
    const testing::DistanceProbe probe = {PrimitiveShape::ellipsoid, a};
    alignas(64) double y[24], fused[8 * testing::kDistanceRows];
    V places[8];
    for (int l = 0; l < 7; ++l) {
      places[l] = along_ray(a, random.uniform(0.9, 1.2), random);
      y[l] = places[l].x, y[8 + l] = places[l].y, y[16 + l] = places[l].z;
    }
    y[7] = y[15] = y[23] = std::numeric_limits<double>::quiet_NaN();
    bool have = false;
    for (const testing::LaneProbe* lanes : testing::lane_probes()) {
      SCOPED_TRACE(lanes->name);
      alignas(64) double got[8 * testing::kDistanceRows], alone[8 * testing::kDistanceRows];
      lanes->distance(probe, y, got);
      lanes->distance_alone(probe, y, alone);
      for (int l = 0; l < 7; ++l) {
        EXPECT_NEAR(got[l], Ellipsoid{a}.evaluate(places[l]).d, 4e-15 * longest(a));
        for (int i = 0; i < testing::kDistanceRows; ++i)
          ASSERT_EQ(got[8 * i + l], alone[8 * i + l]) << "row " << i << ", lane " << l;
      }
      if (std::strncmp(lanes->name, "avx", 3) != 0) continue;
      for (int i = 0; have && i < testing::kDistanceRows; ++i)
        ASSERT_EQ(std::memcmp(got + 8 * i, fused + 8 * i, 56), 0);
      std::memcpy(fused, got, sizeof got);
      have = true;
    }
  }
}

}  // namespace
}  // namespace tangere
