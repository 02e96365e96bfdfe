// SPDX-License-Identifier: Apache-2.0
// How a finger turns a cap when everything is known: where its pad is, where it should go, and the angles for that. It
// goes back out of touch, presses, and moves along the cap until it runs out of pad.
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

  /// From the cap to the nearest edge of the pad's face, along the finger's radius [m]; negative: it would touch.
  [[nodiscard]] double gap(const FingerAngles& q) const;
  /// Whether a finger presses next, given whether it does now.
  [[nodiscard]] bool presses(const FingerAngles& q, bool now) const;
  /// Where the angles should go.
  [[nodiscard]] FingerAngles targets(const FingerAngles& q, bool pressing) const;

 private:
  /// Of the pad's middle [m]: from the cap's axis outward, along the stroke, below the hip.
  [[nodiscard]] std::array<double, 3> place(const FingerAngles& q) const;
  [[nodiscard]] FingerAngles angles_at(const std::array<double, 3>& place) const;

  double hip_ = 0, upper_ = 0, lower_ = 0;  // hip from the axis, lengths of the links [m]
  double radius_ = 0;                       // of the cap [m]
  double half_height_ = 0, half_thickness_ = 0;  // of a pad [m]
  double below_ = 0;                             // pads work so far below the hip: at the middle of the cap [m]
};

}  // namespace tangere
