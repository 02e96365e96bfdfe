// SPDX-License-Identifier: Apache-2.0
// Tests rotations: the series against closed forms in long double, identities, and derivatives by
// dual numbers.
#include <gtest/gtest.h>

#include "engine/step/rotation_log.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/numbers/so3.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using namespace kernels;
using D = Dual<double>;
using testing::Random;

const double kLengths[] = {0, 1e-300, 1e-160, 1e-12, 1e-8, 1e-4, 1e-2, 0.3, 1, 2, 3, 3.14159};

double largest_difference(const Mat3<double>& a, const Mat3<double>& b) {
  double worst = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) worst = std::max(worst, std::abs(a.m[i][j] - b.m[i][j]));
  return worst;
}

/// Rodrigues' formula in long double, where the closed form is accurate.
Mat3<double> rodrigues(const Vec3<double>& axis, double angle) {
  const long double s = sinl(angle), c = 1 - cosl(angle);
  const Mat3<double> X = skew(axis), X2 = X * X;
  Mat3<double> r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      r.m[i][j] = double((i == j ? 1.0L : 0.0L) + s * X.m[i][j] + c * X2.m[i][j]);
  return r;
}

TEST(Rotation, ExponentialIsRodrigues) {
  Random random(1);
  for (double length : kLengths)
    for (int k = 0; k < 20; ++k) {
      const Vec3<double> axis = random.direction();
      const Vec3<double> x = length * axis;
      EXPECT_LT(largest_difference(rotation_exp(x, rotation_series(x)), rodrigues(axis, length)),
                2e-15)
          << length;
    }
}

TEST(Rotation, QuaternionAndMatrixExponentialsAgree) {
  Random random(2);
  for (double length : kLengths) {
    const Vec3<double> x = length * random.direction();
    EXPECT_LT(largest_difference(to_matrix(quaternion_exp(x)), rotation_exp(x, rotation_series(x))),
              2e-15)
        << length;
  }
}

TEST(Rotation, LogInvertsExp) {
  Random random(3);
  for (double length : kLengths)
    for (int k = 0; k < 20; ++k) {
      const Vec3<double> x = length * random.direction();
      const Vec3<double> back = rotation_log(quaternion_exp(x));
      const Vec3<double> miss = back - x;
      EXPECT_LE(std::sqrt(dot(miss, miss)), 1e-15 + 1e-15 * length) << length;
    }
}

TEST(Rotation, RightJacobianIsTheBodyRate) {
  // ω of R = exp(x + ε w): vee(Rᵀ dR/dε), dR/dε by dual numbers.
  Random random(4);
  for (double length : kLengths) {
    const Vec3<double> x = length * random.direction(), w = random.vector(1);
    const Vec3<D> xd = {{x.x, w.x}, {x.y, w.y}, {x.z, w.z}};
    const Mat3<D> R = rotation_exp(xd, rotation_series(xd));
    Mat3<double> value, rate;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) value.m[i][j] = R.m[i][j].value, rate.m[i][j] = R.m[i][j].epsilon;
    const Mat3<double> omega = transpose(value) * rate;
    const Vec3<double> expected = right_jacobian(x, rotation_series(x)) * w;
    EXPECT_NEAR(omega.m[2][1], expected.x, 1e-14);
    EXPECT_NEAR(omega.m[0][2], expected.y, 1e-14);
    EXPECT_NEAR(omega.m[1][0], expected.z, 1e-14);
  }
}

TEST(Rotation, RightJacobianDerivativeMatchesDualNumbers) {
  Random random(5);
  for (double length : kLengths)
    for (int k = 0; k < 20; ++k) {
      const Vec3<double> x = length * random.direction(), w = random.vector(1),
                         e = random.vector(1);
      const Vec3<D> xd = {{x.x, e.x}, {x.y, e.y}, {x.z, e.z}};
      const Vec3<D> wd = {D(w.x), D(w.y), D(w.z)};
      const Vec3<D> dual = right_jacobian(xd, rotation_series(xd)) * wd;
      const Vec3<double> analytic = right_jacobian_derivative(x, rotation_series(x), w) * e;
      EXPECT_NEAR(dual.x.epsilon, analytic.x, 2e-14) << length;
      EXPECT_NEAR(dual.y.epsilon, analytic.y, 2e-14) << length;
      EXPECT_NEAR(dual.z.epsilon, analytic.z, 2e-14) << length;
    }
}

TEST(Rotation, ManyStepsStayUnit) {
  Random random(6);
  Quat<double> q = random.quaternion();
  for (int k = 0; k < 10000; ++k) q = rotate_by(q, random.vector(0.3));
  EXPECT_NEAR(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1, 1e-15);
}

TEST(Rotation, AnglesReduceToOneTurn) {
  for (double turns : {-1000.0, -3.0, 0.0, 1.0, 12345.0})
    for (double angle : {-3.1, -1.0, 0.0, 1e-9, 3.1}) {
      const double full = turns * 6.283185307179586 + angle;
      EXPECT_NEAR(reduce_angle(full), std::remainder(full, 6.283185307179586),
                  1e-15 * (1 + std::abs(turns)));
    }
  EXPECT_EQ(reduce_angle(D(100.0, 1.0)).epsilon, 1.0);
}

}  // namespace
}  // namespace tangere
