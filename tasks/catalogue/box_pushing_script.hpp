// SPDX-License-Identifier: Apache-2.0
// How to push a box to a pose when the whole state is known: computes the velocity that the box
// should have, the velocity of the hand that gives it, and the forces that this takes.
#pragma once

#include <array>

#include "engine/scene/scene.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere {

struct PushState {
  double turn = 0;                ///< of the hand [rad]
  std::array<double, 2> slide{};  ///< in the hand's own x and y [m]
  std::array<double, 3> box{};    ///< x, y, yaw in the world [m, rad]
  std::array<double, 3> goal{};
};

/// Gains of the script. They depend on the friction of skin and ground.
struct PushGains {
  double swing, cone;    ///< the face aims past the goal by `swing` rad per rad of its yaw, at most
                         ///< `cone` [rad]
  double rate, fastest;  ///< approach to the goal [1/s], [m/s]
  double turn_rate, fastest_turn;  ///< of the hand [1/s], [rad/s]
  double lead, most_lead;          ///< lead of the hand: per rad that the box lacks, at most [rad]
  double sideways;                 ///< largest angle between push and the box's x axis [rad]
  double here;                     ///< [m]: nearer than this, the box turns to the goal's yaw
  double grip;                     ///< tip to face [1/s]
  double press;                    ///< depth of the tip's target in the face [m]
  double slowing;                  ///< [rad]: if the way is farther off, the box is slower
  double creep;                    ///< [m/s]: below this speed less force is added for the ground
  double friction;  ///< force that is added for the ground [N]; its limit μ m g is 0.59 N
};

class PushScript {
 public:
  /// Reads the places of the joints and of the end effectors "tip" and "face" from the scene.
  PushScript(const Scene& scene, Friction friction);

  /// Returns the controls of the hand's motors: x, y, turn. They exceed ±1 where a motor is too
  /// weak.
  [[nodiscard]] std::array<double, 3> controls(const PushState& state) const;
  [[nodiscard]] const std::array<double, 2>& box_rest() const {
    return box_rest_;
  }  ///< where q = 0 is [m]

 private:
  PushGains gains_;
  std::array<double, 2> base_{}, tip_{}, face_{}, box_rest_{};
};

}  // namespace tangere
