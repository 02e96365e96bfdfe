// SPDX-License-Identifier: Apache-2.0
// Vectors of a scene, and the arithmetic that reading a scene needs.
#pragma once

#include <array>
#include <cmath>

namespace tangere {

using Vector3 = std::array<double, 3>;  ///< x y z

inline Vector3 operator+(const Vector3& a, const Vector3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
inline Vector3 operator-(const Vector3& a, const Vector3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Vector3 operator*(double s, const Vector3& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double dot(const Vector3& a, const Vector3& b) {
  return a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]);
}
inline Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
/// Returns the vector scaled to length one.
inline Vector3 unit(const Vector3& a) { return (1 / std::sqrt(dot(a, a))) * a; }

}  // namespace tangere
