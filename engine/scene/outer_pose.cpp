// SPDX-License-Identifier: Apache-2.0
// Poses of a scene by the kernels' frames.
#include "engine/scene/outer_pose.hpp"

#include "engine/scene/frames.hpp"

namespace tangere {

Vector3 outer_point(const Pose& pose, const Vector3& point) {
  const kernels::Frame<double> at = to_frame(pose);
  const kernels::Vec3<double> p = at.R * vec3_of(point) + at.p;
  return {p.x, p.y, p.z};
}

Vector3 outer_direction(const Pose& pose, const Vector3& direction) {
  const kernels::Vec3<double> d = to_frame(pose).R * vec3_of(direction);
  return {d.x, d.y, d.z};
}

Pose pose_at_end(std::span<const Pose> way, const Pose& pose) {
  kernels::Frame<double> end = to_frame(way.front());
  for (const Pose& next : way.subspan(1)) end = compose(end, to_frame(next));
  const kernels::Frame<double> local = relative(end, to_frame(pose));
  const kernels::Quat<double> q = quaternion_of(local.R);
  return {{local.p.x, local.p.y, local.p.z}, {q.w, q.x, q.y, q.z}};
}

}  // namespace tangere
