// SPDX-License-Identifier: Apache-2.0
// Tests distance functions: exact values, unit gradients, Hessians by differences, finite on kinks.
#include <gtest/gtest.h>

#include <algorithm>

#include "kernels/contact/distance.hpp"
#include "kernels/numbers/dual.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using namespace kernels;
using D = Dual<double>;
using testing::Random;

Vec3<D> seeded(const Vec3<double>& y, const Vec3<double>& e) {
  return {{y.x, e.x}, {y.y, e.y}, {y.z, e.z}};
}

/// Distance to a box by brute force. Inside, the nearest of many surface samples bounds it from
/// above. Outside, clamping is exact.
double box_distance(const Vec3<double>& y, const Vec3<double>& s) {
  const double q[3] = {std::abs(y.x) - s.x, std::abs(y.y) - s.y, std::abs(y.z) - s.z};
  double square = 0;
  for (double c : q) square += std::max(c, 0.0) * std::max(c, 0.0);
  if (square > 0) return std::sqrt(square);
  return std::max({q[0], q[1], q[2]});
}

TEST(Distance, CuboidIsExactInsideAndOutside) {
  Random random(11);
  const Vec3<double> half = {0.3, 0.5, 0.2};
  const CuboidDistance<double> box{half};
  for (int k = 0; k < 2000; ++k) {
    const Vec3<double> y = random.vector(0.4);
    double unused = 0;
    const Distance<double> at = box.evaluate(y, unused);
    EXPECT_DOUBLE_EQ(at.d, box_distance(y, half));
    EXPECT_NEAR(dot(at.n, at.n), 1, 1e-14);
    // The nearest surface point has distance zero.
    const Vec3<double> foot = y - at.d * at.n;
    EXPECT_NEAR(box_distance(foot, half), 0, 1e-14);
  }
}

TEST(Distance, GradientAndHessianMatchDualNumbers) {
  Random random(12);
  const Vec3<double> half = {0.3, 0.5, 0.2};
  for (int k = 0; k < 500; ++k) {
    const Vec3<double> y = random.vector(0.5), e = random.vector(1);
    {
      D unused;
      const CuboidDistance<D> box{{D(half.x), D(half.y), D(half.z)}};
      const Distance<D> at = box.evaluate(seeded(y, e), unused);
      const Vec3<double> n = {at.n.x.value, at.n.y.value, at.n.z.value};
      EXPECT_NEAR(at.d.epsilon, dot(n, e), 1e-13);
      const Vec3<double> turn = CuboidDistance<double>{half}.hessian(y) * e;
      EXPECT_NEAR(at.n.x.epsilon, turn.x, 1e-9 * (1 + std::abs(turn.x)));
      EXPECT_NEAR(at.n.z.epsilon, turn.z, 1e-9 * (1 + std::abs(turn.z)));
    }
    {
      D curvature;
      const Distance<D> at = SphereDistance<D>{D(0.2)}.evaluate(seeded(y, e), curvature);
      const Vec3<double> n = {at.n.x.value, at.n.y.value, at.n.z.value};
      const Vec3<double> turn = curvature.value * (e - dot(n, e) * n);
      EXPECT_NEAR(at.d.epsilon, dot(n, e), 1e-13);
      EXPECT_NEAR(at.n.y.epsilon, turn.y, 1e-11 * (1 + std::abs(turn.y)));
    }
  }
}

TEST(Distance, KinksHaveADefinedUnitNormal) {
  double k = 1;
  const Distance<double> centre = SphereDistance<double>{0.1}.evaluate({0, 0, 0}, k);
  EXPECT_EQ(centre.d, -0.1);
  EXPECT_EQ(centre.n.z, 1);
  EXPECT_EQ(k, 0);
  const CuboidDistance<double> cube{{1, 1, 1}};
  const Distance<double> middle = cube.evaluate({0, 0, 0}, k);
  EXPECT_EQ(middle.d, -1);
  EXPECT_EQ(middle.n.x, 1);  // ties go to x, and zero counts as positive
  for (const Vec3<double>& y :
       {Vec3<double>{1, 1, 1}, Vec3<double>{1, 1, 0}, Vec3<double>{-1, 0, 0}}) {
    const Distance<double> at = cube.evaluate(y, k);
    EXPECT_EQ(at.d, 0);
    EXPECT_EQ(dot(at.n, at.n), 1);
  }
}

}  // namespace
}  // namespace tangere
