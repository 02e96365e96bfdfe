// SPDX-License-Identifier: Apache-2.0
// Plain formulas: a robot is read once.
#include "io/robot/rotations.hpp"
#include "engine/scene/outer_pose.hpp"

#include <cctype>
#include <cmath>

namespace tangere {

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Quaternion turn(const Vector3& axis, double angle) {
  const double s = std::sin(0.5 * angle);
  return {std::cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2]};
}

Pose compose(const Pose& outer, const Pose& inner) {
  return {outer_point(outer, inner.position), product(outer.orientation, inner.orientation)};
}

Pose inverse(const Pose& pose) {
  const Quaternion& q = pose.orientation;
  const Pose turned = {{0, 0, 0}, {q[0], -q[1], -q[2], -q[3]}};
  const Vector3 p = outer_direction(turned, pose.position);
  return {{-p[0], -p[1], -p[2]}, turned.orientation};
}

Quaternion from_euler(const Vector3& angles, const std::string& sequence) {
  Quaternion q = {1, 0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto letter = static_cast<unsigned char>(sequence[k]);
    Vector3 axis = {0, 0, 0};
    axis[std::size_t(std::tolower(letter) - 'x')] = 1;
    const Quaternion next = turn(axis, angles[k]);
    q = std::islower(letter) != 0 ? product(q, next) : product(next, q);
  }
  return q;
}

Quaternion from_rpy(const Vector3& angles) { return from_euler(angles, "XYZ"); }

Quaternion from_z(const Vector3& direction) {
  const double length = std::sqrt(dot(direction, direction));
  const Vector3 d = {direction[0] / length, direction[1] / length, direction[2] / length};
  const double across = std::hypot(d[0], d[1]);
  // Closer to z than this, the axis is lost in rounding, and x is as good as any other.
  const Vector3 axis =
      across < 1e-10 ? Vector3{1, 0, 0} : Vector3{-d[1] / across, d[0] / across, 0};
  return turn(axis, std::atan2(across, d[2]));
}

Quaternion from_axes(const Vector3& x, const Vector3& y) {
  const auto unit = [](const Vector3& a) {
    const double length = std::sqrt(dot(a, a));
    return Vector3{a[0] / length, a[1] / length, a[2] / length};
  };
  const Vector3 e0 = unit(x);
  const double along = dot(e0, y);
  const Vector3 e1 = unit({y[0] - along * e0[0], y[1] - along * e0[1], y[2] - along * e0[2]});
  const Vector3 e2 = cross(e0, e1);
  // Of the four components the largest is computed first, so that nothing cancels.
  const double m[3][3] = {{e0[0], e1[0], e2[0]}, {e0[1], e1[1], e2[1]}, {e0[2], e1[2], e2[2]}};
  Quaternion q{};
  const double trace = m[0][0] + m[1][1] + m[2][2];
  if (trace > 0) {
    const double s = 2 * std::sqrt(1 + trace);
    q = {s / 4, (m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s};
  } else {
    std::size_t i = 0;
    if (m[1][1] > m[0][0]) i = 1;
    if (m[2][2] > m[i][i]) i = 2;
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    const double s = 2 * std::sqrt(1 + m[i][i] - m[j][j] - m[k][k]);
    q[0] = (m[k][j] - m[j][k]) / s;
    q[i + 1] = s / 4;
    q[j + 1] = (m[j][i] + m[i][j]) / s;
    q[k + 1] = (m[k][i] + m[i][k]) / s;
  }
  return q;
}

}  // namespace tangere
