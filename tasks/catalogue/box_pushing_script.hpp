// SPDX-License-Identifier: Apache-2.0
// How to push a box to a pose when everything is known: the velocity that the box should have, the
// hand's that gives it, and the forces for that.
#pragma once

#include <array>

#include "engine/model/scene.hpp"

namespace tangere {

struct PushState {
  double turn = 0;                ///< of the hand [rad]
  std::array<double, 2> slide{};  ///< in the hand's own x and y [m]
  std::array<double, 3> box{};    ///< x, y, yaw in the world [m, rad]
  std::array<double, 3> goal{};
};

class PushScript {
 public:
  /// Takes places of joints and the end effectors tip and face from the scene.
  explicit PushScript(const Scene& scene);

  /// Of the hand's motors: x, y, turn; beyond ±1 where they are too weak.
  [[nodiscard]] std::array<double, 3> controls(const PushState& state) const;
  [[nodiscard]] const std::array<double, 2>& box_rest() const {
    return box_rest_;
  }  ///< where q = 0 is [m]

 private:
  std::array<double, 2> base_{}, tip_{}, face_{}, box_rest_{};
};

}  // namespace tangere
