// SPDX-License-Identifier: Apache-2.0
// How four fingers turn an object that they hold: targets of their angles, and derivatives by the
// action. All four press and go around the palm's axis. Then two opposite fingers let go, go back
// and press again while the others hold, and the others do so after them.
#pragma once

#include <array>
#include <span>
#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

class InHandGait {
 public:
  static constexpr std::size_t kFingers = 4, kAngles = 12, kAction = 4;
  static constexpr int kSteps = 250;     ///< simulation steps of an action
  static constexpr double kTurn = 0.35;  ///< angle of a tip around the axis at turn = 1 [rad]
  static constexpr double kLift = 4e-3;  ///< height that a tip rises at lift = 1 [m]
  static constexpr double kGrip = 3, kMore = 1.5;  ///< force of a tip: 3 N + 1.5 N grip

  /// Reads lengths and gains from the scene: places of the joints palm, swing_1, lower_1, tip_1 and
  /// `object`, and P of the motors of the first finger. All fingers are like the first, a quarter
  /// of a turn apart. Throws InputError where one of them is missing.
  InHandGait(const Scene& scene, const std::string& object);

  /// Fills the targets (12) of the angles [rad] of a step of an action: swing, upper and lower of
  /// each finger. `action` (4): turn, lift, grip of fingers 1 and 3, grip of fingers 2 and 4, each
  /// in [-1, 1].
  void targets(std::span<const double> action, int step, std::span<double> u) const;
  /// Fills the targets (12) on the way from open fingers (share 0) to pressing ones (share 1).
  void closing(double share, std::span<double> u) const;
  /// Adds ∂(weight · targets)/∂action to `action_bar` (4).
  void targets_vjp(std::span<const double> action, int step, std::span<const double> weight,
                   std::span<double> action_bar) const;

 private:
  template <class S>
  using Angles = std::array<S, 3>;
  /// Where a tip's middle is: its distance from the palm's axis [m], the angle around it from the
  /// direction of the finger [rad], and its height above the object's place [m].
  template <class S>
  struct Place {
    S out, around, height;
  };
  template <class S>
  [[nodiscard]] Angles<S> angles_at(const Place<S>& place) const;
  /// Target angles of a finger that presses with `force` [N] towards the axis with its tip there.
  template <class S>
  [[nodiscard]] Angles<S> pressing(const Place<S>& place, const S& force) const;
  template <class S>
  [[nodiscard]] Angles<S> targets_of_pair(std::span<const S> action, int step,
                                          std::size_t pair) const;

  double hip_ = 0, upper_ = 0, lower_ = 0;  // distance of the hips from the axis, links [m]
  double below_ = 0;                        // depth of the object's place below the hips [m]
  std::array<double, 3> gain_{};            // of the motors [N m/rad]
};

}  // namespace tangere
