// SPDX-License-Identifier: Apache-2.0
// Where a frame is in another.
#pragma once

#include <array>

#include "engine/base/vector3.hpp"

namespace tangere {

using Quaternion = std::array<double, 4>;  ///< w x y z, unit length

/// A frame relative to another: x_outer = R(orientation) x_inner + position [m].
struct Pose {
  Vector3 position{0, 0, 0};
  Quaternion orientation{1, 0, 0, 0};
};

}  // namespace tangere
