// SPDX-License-Identifier: Apache-2.0
// A motor has one control for each dof of its joint.
#include "engine/scene/control_bounds.hpp"

namespace tangere {

std::vector<std::array<double, 2>> control_bounds(const Scene& scene) {
  std::vector<std::array<double, 2>> bounds;
  for (const MotorDescription& motor : scene.motors) {
    const bool plain_force = motor.control == MotorControl::force && !motor.scale;
    bounds.insert(bounds.end(), std::size_t(dofs_driven(scene, motor)),
                  plain_force ? std::array{-1.0, 1.0} : motor.u_range);
  }
  return bounds;
}

}  // namespace tangere
