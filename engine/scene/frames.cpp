// SPDX-License-Identifier: Apache-2.0
// Rotations of unit quaternions and back.
#include "engine/scene/frames.hpp"

#include <cmath>

namespace tangere {

kernels::Frame<double> to_frame(const Pose& pose) {
  const Quaternion& o = pose.orientation;
  const double scale = 1 / std::sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2] + o[3] * o[3]);
  const kernels::Quat<double> q = {scale * o[0], scale * o[1], scale * o[2], scale * o[3]};
  return {kernels::to_matrix(q), {pose.position[0], pose.position[1], pose.position[2]}};
}

kernels::Quat<double> quaternion_of(const kernels::Mat3<double>& R) {
  // The divisor is the largest of the four squares, which is never near zero.
  const auto& m = R.m;
  const double w = 1 + m[0][0] + m[1][1] + m[2][2], x = 1 + m[0][0] - m[1][1] - m[2][2];
  const double y = 1 - m[0][0] + m[1][1] - m[2][2], z = 1 - m[0][0] - m[1][1] + m[2][2];
  kernels::Quat<double> q;
  if (w >= x && w >= y && w >= z) {
    q = {w, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]};
  } else if (x >= y && x >= z) {
    q = {m[2][1] - m[1][2], x, m[0][1] + m[1][0], m[0][2] + m[2][0]};
  } else if (y >= z) {
    q = {m[0][2] - m[2][0], m[0][1] + m[1][0], y, m[1][2] + m[2][1]};
  } else {
    q = {m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], z};
  }
  double scale = 1 / std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  if (q.w < 0) scale = -scale;
  return {scale * q.w, scale * q.x, scale * q.y, scale * q.z};
}

}  // namespace tangere
