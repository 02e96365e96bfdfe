// SPDX-License-Identifier: Apache-2.0
// What a batch is measured by: poses and twists of bodies, tactile fields. Reads the state, changes nothing.
#pragma once

#include <span>

#include "engine/batch.hpp"

namespace tangere {

/// World poses (nb, 7: x y z qw qx qy qz of the body frame) and twists (nb, 6: angular, then linear velocity of the
/// body frame's origin, world axes) of one environment, every body of the scene in file order.
void read_bodies(const Batch& batch, int environment, std::span<double> pose, std::span<double> twist);

/// Tactile field of one sensor and environment, (points, 3) [N]. Zero, exactly, where nothing touches.
void read_tactile(const Batch& batch, int environment, int sensor, std::span<double> force);

}  // namespace tangere
