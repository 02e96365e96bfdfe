// SPDX-License-Identifier: Apache-2.0
// Tests rotation vectors without an arc tangent against the library's, closed forms in long double,
// and dual numbers.
#include "kernels/numbers/rotation_vector.hpp"

#include <gtest/gtest.h>

#include "engine/step/rotation_log.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using namespace kernels;
using D = Dual<double>;
using testing::Random;

const double kLengths[] = {0, 1e-300, 1e-160, 1e-12, 1e-8, 1e-4, 1e-2, 0.3, 1, 2, 3, 3.14159};

Vec3<D> along(const Vec3<double>& x, const Vec3<double>& e) {
  return {{x.x, e.x}, {x.y, e.y}, {x.z, e.z}};
}
Vec3<double> epsilon(const Vec3<D>& x) { return {x.x.epsilon, x.y.epsilon, x.z.epsilon}; }
double length_of(const Vec3<double>& x) { return std::sqrt(dot(x, x)); }

TEST(RotationVector, IsTheLogarithm) {
  Random random(1);
  for (double length : kLengths)
    for (int k = 0; k < 20; ++k) {
      const Vec3<double> x = length * random.direction();
      const Quat<double> q = quaternion_exp(x);
      EXPECT_LE(length_of(rotation_vector<false>(q).phi - x), 1e-15 + 1e-15 * length) << length;
      EXPECT_LE(length_of(rotation_vector<false>(q).phi - rotation_log(q)), 1e-15 + 1e-15 * length)
          << length;
      const Quat<double> same = {-q.w, -q.x, -q.y, -q.z};
      EXPECT_LE(length_of(rotation_vector<true>(same).phi - x), 1e-15 + 1e-15 * length) << length;
    }
}

TEST(RotationVector, FactorsMatchTheClosedForms) {
  for (double length : {0.05, 0.3, 1.0, 2.0, 3.0, 3.14159}) {
    const RotationVector<double> v =
        rotation_vector<true>(quaternion_exp(Vec3<double>{0, 0, length}));
    const long double a = length, half = a / 2;
    const auto e = [](long double t) { return (1 - sqrtl(t) / 2 / tanl(sqrtl(t) / 2)) / t; };
    EXPECT_NEAR(v.e, double((1 - half / tanl(half)) / (a * a)), 1e-15) << length;
    const long double step = 1e-5L * a * a;
    EXPECT_NEAR(v.e1, double((e(a * a + step) - e(a * a - step)) / step), 1e-9) << length;
  }
  const RotationVector<double> none = rotation_vector<true>(Quat<double>{1, 0, 0, 0});
  EXPECT_NEAR(none.e, 1.0 / 12, 1e-17);  // 1/12 + t/720 + …
  EXPECT_NEAR(none.e1, 2.0 / 720, 1e-17);
}

TEST(RotationVector, InverseJacobiansInvert) {
  Random random(2);
  for (double length : kLengths) {
    const Vec3<double> x = length * random.direction(), w = random.vector(1);
    const RotationVector<double> v = rotation_vector<false>(quaternion_exp(x));
    const Mat3<double> J = right_jacobian(x, rotation_series(x));
    EXPECT_LT(length_of(inverse_right_jacobian(v) * (J * w) - w), 1e-14 * length_of(w)) << length;
    EXPECT_LT(length_of(inverse_left_jacobian(v) * (transpose(J) * w) - w), 1e-14 * length_of(w))
        << length;
  }
}

TEST(RotationVector, DerivativesMatchDualNumbers) {
  Random random(3);
  for (double length : kLengths)
    for (int k = 0; k < 20; ++k) {
      const Vec3<double> x = length * random.direction(), f = random.vector(1),
                         e = random.vector(1);
      const Quat<double> q = quaternion_exp(x);
      const Quat<D> still = {D(q.w), D(q.x), D(q.y), D(q.z)},
                    turn = quaternion_exp(along({0, 0, 0}, e));
      const RotationVector<double> v = rotation_vector<true>(q);
      EXPECT_LT(length_of(epsilon(rotation_vector<false>(still * turn).phi) -
                          inverse_right_jacobian(v) * e),
                1e-13)
          << length;
      EXPECT_LT(length_of(epsilon(rotation_vector<false>(turn * still).phi) -
                          inverse_left_jacobian(v) * e),
                1e-13)
          << length;
      const RotationVector<D> moved = rotation_vector<false>(quaternion_exp(along(x, e)));
      const Vec3<D> force = {D(f.x), D(f.y), D(f.z)};
      EXPECT_LT(length_of(epsilon(inverse_left_jacobian(moved) * force) -
                          inverse_left_jacobian_derivative(v, f) * e),
                1e-13)
          << length;
    }
}

}  // namespace
}  // namespace tangere
