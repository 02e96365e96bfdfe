// SPDX-License-Identifier: Apache-2.0
// How a finger turns a cap when the whole state is known: computes where its tip is, where the tip
// should go, and the angles for that. The finger moves back without touching, presses, and goes
// around the cap as far as it reaches.
#pragma once

#include <array>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Angles of a finger: swing, upper, lower [rad].
using FingerAngles = std::array<double, 3>;

/// A cap in a finger's frame: its radius, and the position of its axis relative to the axis around
/// which the fingers stand, along the finger's radius and to its left [m].
struct CapView {
  double radius = 0, out = 0, left = 0;
};

class CapScript {
 public:
  /// Reads lengths from the scene. All three fingers are like the first.
  explicit CapScript(const Scene& scene);

  /// Distance from the cap to the tip [m]; negative if they overlap.
  [[nodiscard]] double gap(const FingerAngles& q, const CapView& cap) const;
  /// Whether a finger presses next, given whether it does now.
  [[nodiscard]] bool presses(const FingerAngles& q, const CapView& cap, bool now) const;
  /// Target angles.
  [[nodiscard]] FingerAngles targets(const FingerAngles& q, const CapView& cap,
                                     bool pressing) const;

 private:
  /// Place of the middle of the tip's sphere: distance from the cap's axis [m], and angle around it
  /// from the direction of the finger [rad].
  struct Place {
    double out, around;
  };
  [[nodiscard]] Place place(const FingerAngles& q, const CapView& cap) const;
  /// Angle at which a stroke ends [rad]; it begins at the negative of this.
  [[nodiscard]] double end(const CapView& cap) const;
  /// Angles that put a tip at `place`, at the height of the cap's middle.
  [[nodiscard]] FingerAngles angles_at(const Place& place, const CapView& cap) const;

  double hip_ = 0, upper_ = 0,
         lower_ = 0;  // distance of the hip from its axis, lengths of the links [m]
  double tip_ = 0;    // radius of a tip [m]
  double below_ = 0;  // depth of the cap's middle, where tips work, below the hip [m]
};

}  // namespace tangere
