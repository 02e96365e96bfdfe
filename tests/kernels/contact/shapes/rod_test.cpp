// SPDX-License-Identifier: Apache-2.0
// Tests distances of half-spaces, cylinders and capsules against a search along their outline in
// long double, against dual numbers and differences, at their kinks, and in lanes of every
// instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "kernels/contact/distance.hpp"
#include "kernels/numbers/dual.hpp"
#include "tests/kernels/lane_probe.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using namespace kernels;
using D = Dual<double>;
using Real = long double;
using testing::DistanceProbe;
using testing::Random;

constexpr double kRadius = 0.3, kHalf = 0.5;
constexpr PrimitiveShape kShapes[] = {PrimitiveShape::plane, PrimitiveShape::cylinder,
                                      PrimitiveShape::capsule};
const Vec3<double> kSize = {kRadius, kHalf, 0};

/// Minimum of f on [a, b], which may have several local minima: samples, then narrows around the
/// best.
template <class F>
Real least(const F& f, Real a, Real b) {
  constexpr int kSamples = 100;
  int best = 0;
  for (int k = 1; k <= kSamples; ++k)
    if (f(a + (b - a) * k / kSamples) < f(a + (b - a) * best / kSamples)) best = k;
  Real low = a + (b - a) * std::max(best - 1, 0) / kSamples,
       high = a + (b - a) * std::min(best + 1, kSamples) / kSamples;
  for (int k = 0; k < 160; ++k) {
    const Real third = (high - low) / 3;
    (f(low + third) < f(high - third) ? high : low) +=
        f(low + third) < f(high - third) ? -third : third;
  }
  return f((low + high) / 2);
}

/// Least distance to the outline in the half plane (ρ ≥ 0, z), negative inside.
Real reference(PrimitiveShape shape, const Vec3<double>& y) {
  if (shape == PrimitiveShape::plane) return y.z;
  const Real rho = std::sqrt(Real(y.x) * y.x + Real(y.y) * y.y), z = y.z, r = kRadius, h = kHalf;
  const auto to = [&](Real a, Real b) {
    return std::sqrt((rho - a) * (rho - a) + (z - b) * (z - b));
  };
  Real found = least([&](Real b) { return to(r, b); }, -h, h);
  bool inside = rho < r && std::abs(z) < h;
  const Real quarter = std::acos(Real(-1)) / 2;
  for (const Real end : {-h, h}) {
    if (shape == PrimitiveShape::cylinder) {
      found = std::min(found, least([&](Real a) { return to(a, end); }, 0, r));
    } else {
      const Real sign = end < 0 ? -1 : 1;
      found = std::min(
          found, least([&](Real t) { return to(r * std::cos(t), end + sign * r * std::sin(t)); }, 0,
                       quarter));
      inside = inside || to(0, end) < r;
    }
  }
  return inside ? -found : found;
}

Distance<double> evaluate(PrimitiveShape shape, const Vec3<double>& y) {
  return with_distance<double>(shape, kSize, [&](const auto& s) { return distance_at(s, y); });
}
double length(const Vec3<double>& a) { return std::sqrt(dot(a, a)); }

class RodDistance : public ::testing::TestWithParam<PrimitiveShape> {};

/// Random places, the places where two formulas meet (axis, ends, faces, rim, seams, origin), and
/// places very near to them.
std::vector<Vec3<double>> special_places() {
  std::vector<Vec3<double>> places;
  for (const double rho :
       {0.0, 1e-300, 1e-160, 1e-20, 0.1, kRadius, std::nextafter(kRadius, 1), kRadius + 1e-9, 0.6})
    for (const double z : {0.0, 1e-300, 0.2, kHalf - kRadius, kHalf, std::nextafter(kHalf, 1),
                           kHalf + 1e-9, kHalf + kRadius, 2.0})
      for (const double sign : {-1.0, 1.0})
        for (const double angle : {0.0, 2.0})
          places.push_back({rho * std::cos(angle), rho * std::sin(angle), sign * z});
  return places;
}

TEST_P(RodDistance, IsTheDistanceToTheOutline) {
  Random random(31);
  std::vector<Vec3<double>> places = special_places();
  for (int k = 0; k < 500; ++k) places.push_back(random.vector(0.4));
  int inside = 0;
  for (const Vec3<double>& y : places) {
    SCOPED_TRACE(std::to_string(y.x) + " " + std::to_string(y.y) + " " + std::to_string(y.z));
    const Distance<double> at = evaluate(GetParam(), y);
    ASSERT_NEAR(at.d, static_cast<double>(reference(GetParam(), y)), 2e-16 * (1 + std::abs(at.d)));
    ASSERT_NEAR(dot(at.n, at.n), 1, 1e-15);
    // From the point back along n lies the surface.
    EXPECT_NEAR(static_cast<double>(reference(GetParam(), y - at.d * at.n)), 0, 1e-15);
    inside += at.d < 0;
  }
  EXPECT_GT(inside, 50);
}

TEST_P(RodDistance, GradientIsTheSlopeOfTheReference) {
  Random random(32);
  int compared = 0;
  for (int k = 0; k < 300; ++k) {
    const Vec3<double> y = random.vector(0.4), e = random.direction();
    const Real step = 1e-6L;
    const auto at = [&](Real s) {
      const double t = static_cast<double>(s);
      return reference(GetParam(), y + t * e);
    };
    const Real ahead = (at(step) - at(0)) / step, behind = (at(0) - at(-step)) / step;
    if (std::abs(ahead - behind) > 1e-4L) continue;  // a kink within the step
    EXPECT_NEAR(dot(evaluate(GetParam(), y).n, e), static_cast<double>((ahead + behind) / 2), 1e-9);
    ++compared;
  }
  EXPECT_GT(compared, 250);
}

TEST_P(RodDistance, GradientAndHessianMatchDualNumbersAndDifferences) {
  Random random(33);
  int kinks = 0;
  for (int k = 0; k < 1000; ++k) {
    const Vec3<double> y = random.vector(0.35), e = random.direction();
    const Vec3<D> dual = {{y.x, e.x}, {y.y, e.y}, {y.z, e.z}};
    const Distance<D> at =
        with_distance<D>(GetParam(), kSize, [&](const auto& s) { return distance_at(s, dual); });
    const Vec3<double> n = {at.n.x.value, at.n.y.value, at.n.z.value};
    const Vec3<double> turn = {at.n.x.epsilon, at.n.y.epsilon, at.n.z.epsilon};
    EXPECT_NEAR(at.d.epsilon, dot(n, e), 1e-14);
    const auto hessian = with_distance<double>(GetParam(), kSize, [&](const auto& s) {
      if constexpr (requires { s.hessian(y); }) {
        return s.hessian(y);
      } else {  // none of the shapes of this test
        return zero33<double>();
      }
    });
    const double scale = 1 + length(hessian * e);
    EXPECT_LT(length(hessian * e - turn), 1e-12 * scale);
    const double h = 1e-7;
    const Vec3<double> difference =
        (0.5 / h) * (evaluate(GetParam(), y + h * e).n - evaluate(GetParam(), y - h * e).n);
    if (length(difference) > 1e4)
      ++kinks;  // across an edge of the medial axis
    else
      EXPECT_LT(length(hessian * e - difference), 1e-5 * scale * scale * scale);
  }
  EXPECT_LT(kinks, 10);
}

/// κ and e, which contact uses, are the Hessian inside.
TEST_P(RodDistance, BendingIsTheHessianInside) {
  Random random(34);
  int inside = 0;
  for (int k = 0; k < 1000; ++k) {
    const Vec3<double> y = random.vector(0.3);
    with_distance<double>(GetParam(), kSize, [&]<class S>(const S& s) {
      if constexpr (S::kBending == Bending::rod) {
        double curvature = 0, straight = 0;
        const Distance<double> at = s.evaluate(y, curvature, straight);
        if (at.d >= 0) return;
        ++inside;
        Mat3<double> expected = diagonal(1.0) - outer(at.n, at.n);
        expected.m[2][2] -= straight;
        const Mat3<double> difference = curvature * expected - s.hessian(y);
        for (const auto& row : difference.m)
          for (double x : row) EXPECT_NEAR(x, 0, 1e-13 * (1 + curvature));
      }
    });
  }
  EXPECT_TRUE(GetParam() == PrimitiveShape::plane || inside > 200);
}

TEST_P(RodDistance, KinksHaveTheirChosenNormal) {
  const auto normal = [](const Vec3<double>& y) { return evaluate(GetParam(), y).n; };
  const auto is = [](const Vec3<double>& n, double x, double y, double z) {
    EXPECT_EQ(n.x, x);
    EXPECT_EQ(n.y, y);
    EXPECT_EQ(n.z, z);
  };
  switch (GetParam()) {
    case PrimitiveShape::cylinder:
      is(normal({0, 0, 0}), 1, 0, 0);                            // the axis: the side, along x
      is(normal({0, 0, -0.4}), 0, 0, -1);                        // on it, nearer to a cap
      is(normal({0, kRadius, kHalf}), 0, 1, 0);                  // the rim: the side
      is(normal({0, kRadius - 0.125, kHalf - 0.125}), 0, 1, 0);  // as far from both: the side
      EXPECT_EQ(evaluate(PrimitiveShape::cylinder, {0, kRadius, kHalf}).d, 0);
      break;
    case PrimitiveShape::capsule:
      is(normal({0, 0, 0.2}), 1, 0, 0);
      is(normal({0, 0, -kHalf}), 1, 0, 0);
      EXPECT_EQ(evaluate(PrimitiveShape::capsule, {0, 0, kHalf}).d, -kRadius);
      break;
    default:
      is(normal({0, 0, 0}), 0, 0, 1);
      EXPECT_GT(evaluate(PrimitiveShape::plane, {1e6, 1e6, -1e6}).d,
                0);  // filler points touch nothing
  }
}

/// Compares lanes of every instruction set, and lanes alone, with plain double. AVX2 and AVX-512
/// agree bit for bit. NaN stays in its lane.
TEST_P(RodDistance, LanesAgreeOnEveryInstructionSet) {
  Random random(35);
  std::vector<Vec3<double>> places = special_places();
  for (int k = 0; k < 800; ++k) places.push_back(random.vector(0.4));
  places.resize(places.size() / 7 * 7);
  const DistanceProbe probe = {GetParam(), kSize};
  for (std::size_t first = 0; first < places.size(); first += 7) {
    alignas(64) double y[24], fused[8 * testing::kDistanceRows];
    bool have = false;
    for (std::size_t l = 0; l < 7; ++l)
      y[l] = places[first + l].x, y[8 + l] = places[first + l].y, y[16 + l] = places[first + l].z;
    y[7] = y[15] = y[23] = NAN;
    for (const testing::LaneProbe* lanes : testing::lane_probes()) {
      SCOPED_TRACE(lanes->name);
      alignas(64) double got[8 * testing::kDistanceRows], alone[8 * testing::kDistanceRows];
      lanes->distance(probe, y, got);
      lanes->distance_alone(probe, y, alone);
      for (std::size_t l = 0; l < 7; ++l) {
        const Distance<double> at = evaluate(GetParam(), places[first + l]);
        ASSERT_NEAR(got[l], at.d, 1e-15 * (1 + std::abs(at.d)));
        const Vec3<double> n = {got[8 + l], got[16 + l], got[24 + l]};
        ASSERT_NEAR(dot(n, n), 1, 1e-14);
        if (first >= special_places().size()) {  // at kinks, the last digit may choose another
          ASSERT_LT(length(n - at.n), 1e-12);
        }
        ASSERT_TRUE(std::isfinite(got[32 + l]));
        if (at.d < 0.01 ||
            at.d > 0.015) {  // at a rim, the test without a root says so a little further out
          ASSERT_EQ(got[40 + l], at.d < 0.01);
        }
        for (int i = 0; i < testing::kDistanceRows; ++i)
          ASSERT_EQ(got[8 * i + l], alone[8 * i + l]) << "row " << i;
      }
      if (std::strncmp(lanes->name, "avx", 3) != 0) continue;
      for (int i = 0; have && i < testing::kDistanceRows; ++i)
        ASSERT_EQ(std::memcmp(got + 8 * i, fused + 8 * i, 56), 0);
      std::memcpy(fused, got, sizeof got);
      have = true;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, RodDistance, ::testing::ValuesIn(kShapes));

}  // namespace
}  // namespace tangere
