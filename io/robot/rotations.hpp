// SPDX-License-Identifier: Apache-2.0
// The ways in which robot files write a rotation, as unit quaternions w x y z.
#pragma once

#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

/// a b: the rotation b, seen from the frame that a has turned.
Quaternion product(const Quaternion& a, const Quaternion& b);
/// A turn by `angle` [rad] about a unit axis.
Quaternion turn(const Vector3& axis, double angle);
/// `inner`, given in the frame `outer`, in the frame in which `outer` is given.
Pose compose(const Pose& outer, const Pose& inner);
/// The frame of which `pose` is seen at the origin.
Pose inverse(const Pose& pose);

/// Angles [rad] about x, y, z in turn. `sequence` has three letters: small ones are axes that turn
/// along, large ones are fixed.
Quaternion from_euler(const Vector3& angles, const std::string& sequence);
/// Roll, pitch and yaw of URDF: about the fixed axes x, y and z.
Quaternion from_rpy(const Vector3& angles);
/// The smallest turn that takes z to a direction. For -z, half a turn about x.
Quaternion from_z(const Vector3& direction);
/// The frame with this x axis, and the component of `y` orthogonal to it as y axis. Neither vector
/// is zero.
Quaternion from_axes(const Vector3& x, const Vector3& y);

}  // namespace tangere
