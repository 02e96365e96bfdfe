// SPDX-License-Identifier: Apache-2.0
// How to push a box to a pose when the whole state is known: computes the velocity that the box
// should have, the velocity of the hand that gives it, and the forces that this takes.
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
  /// Reads the places of the joints and of the end effectors "tip" and "face" from the scene.
  explicit PushScript(const Scene& scene);

  /// Returns the controls of the hand's motors: x, y, turn. They exceed ±1 where a motor is too
  /// weak.
  [[nodiscard]] std::array<double, 3> controls(const PushState& state) const;
  [[nodiscard]] const std::array<double, 2>& box_rest() const {
    return box_rest_;
  }  ///< where q = 0 is [m]

 private:
  std::array<double, 2> base_{}, tip_{}, face_{}, box_rest_{};
};

}  // namespace tangere
