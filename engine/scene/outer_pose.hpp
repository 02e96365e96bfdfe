// SPDX-License-Identifier: Apache-2.0
// Points, directions and poses seen from another frame.
#pragma once

#include <span>

#include "engine/scene/pose.hpp"

namespace tangere {

/// Return a point and a direction of the inner frame, expressed in the outer frame.
Vector3 outer_point(const Pose& pose, const Vector3& point);
Vector3 outer_direction(const Pose& pose, const Vector3& direction);
/// Returns `pose` expressed in the last frame of `way`. Each frame of `way` is given in the one
/// before. `pose` is given in the same frame as the first.
Pose pose_at_end(std::span<const Pose> way, const Pose& pose);

}  // namespace tangere
