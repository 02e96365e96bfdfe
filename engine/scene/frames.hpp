// SPDX-License-Identifier: Apache-2.0
// Converts vectors and poses of a scene to the kernels' vectors and frames, and back.
#pragma once

#include "engine/scene/pose.hpp"
#include "kernels/numbers/so3.hpp"

namespace tangere {

inline const kernels::Frame<double> kIdentityFrame = {kernels::diagonal(1.0), {0, 0, 0}};

inline kernels::Vec3<double> vec3_of(const Vector3& a) { return {a[0], a[1], a[2]}; }

kernels::Frame<double> to_frame(const Pose& pose);
/// Returns a quaternion of length one with w ≥ 0.
kernels::Quat<double> quaternion_of(const kernels::Mat3<double>& R);

}  // namespace tangere
