// SPDX-License-Identifier: Apache-2.0
// Seeded random geometry for tests.
#pragma once

#include <cmath>
#include <random>

#include "kernels/numbers/so3.hpp"

namespace tangere::testing {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(engine_);
  }
  double normal() { return std::normal_distribution<double>()(engine_); }
  int integer(int a, int b) { return std::uniform_int_distribution<int>(a, b)(engine_); }
  kernels::Vec3<double> vector(double scale) {
    return {scale * normal(), scale * normal(), scale * normal()};
  }
  kernels::Vec3<double> direction() {
    const auto v = vector(1);
    return (1 / std::sqrt(dot(v, v))) * v;
  }
  kernels::Quat<double> quaternion() {
    const double w = normal(), x = normal(), y = normal(), z = normal();
    const double s = 1 / std::sqrt(w * w + x * x + y * y + z * z);
    return {s * w, s * x, s * y, s * z};
  }
  kernels::Mat3<double> rotation() { return to_matrix(quaternion()); }
  kernels::Vec6<double> motion(double scale) { return {vector(scale), vector(scale)}; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace tangere::testing
