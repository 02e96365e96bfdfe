// SPDX-License-Identifier: Apache-2.0
// log of a rotation by its quaternion. It is exact up to π, where only the sign of the vector is
// undetermined.
#pragma once

#include <cmath>

#include "kernels/numbers/so3.hpp"

namespace tangere {

/// Returns the rotation vector x with exp(x) = q, |x| ≤ π. θ = 2 atan2(|u|, w), x = θ u/|u|; a
/// series where |u| is small.
inline kernels::Vec3<double> rotation_log(kernels::Quat<double> q) {
  if (q.w < 0) q = {-q.w, -q.x, -q.y, -q.z};
  const kernels::Vec3<double> u = {q.x, q.y, q.z};
  const double square = dot(u, u);
  if (square < 1e-4) {
    const double r = square / (q.w * q.w);
    return (2 / q.w * (1 - r * (1.0 / 3 - r * (1.0 / 5 - r * (1.0 / 7 - r / 9))))) * u;
  }
  const double length = std::sqrt(square);
  return (2 * std::atan2(length, q.w) / length) * u;
}

}  // namespace tangere
