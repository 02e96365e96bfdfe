// SPDX-License-Identifier: Apache-2.0
// How a finger turns a cap when everything is known: where its tip is, where it should go, and the angles for that. It
// goes back out of touch, presses, and goes around the cap as far as it reaches.
#pragma once

#include <array>

#include "engine/scene.hpp"

namespace tangere {

/// Angles of a finger: swing, upper, lower [rad].
using FingerAngles = std::array<double, 3>;

class CapScript {
 public:
  /// Takes lengths from the scene: all three fingers are like the first.
  explicit CapScript(const Scene& scene);

  /// From the cap to the tip [m]; negative: they would touch.
  [[nodiscard]] double gap(const FingerAngles& q) const;
  /// Whether a finger presses next, given whether it does now.
  [[nodiscard]] bool presses(const FingerAngles& q, bool now) const;
  /// Where the angles should go.
  [[nodiscard]] FingerAngles targets(const FingerAngles& q, bool pressing) const;

 private:
  /// Of the middle of the tip's sphere: from the cap's axis [m], around it [rad] from where the finger points.
  struct Place {
    double out, around;
  };
  [[nodiscard]] Place place(const FingerAngles& q) const;
  /// Angles at which a tip is there, at the height of the cap's middle.
  [[nodiscard]] FingerAngles angles_at(const Place& place) const;

  double hip_ = 0, upper_ = 0, lower_ = 0;  // hip from the axis, lengths of the links [m]
  double radius_ = 0, tip_ = 0;             // of the cap and of a tip [m]
  double below_ = 0;                        // tips work so far below the hip: at the middle of the cap [m]
};

}  // namespace tangere
