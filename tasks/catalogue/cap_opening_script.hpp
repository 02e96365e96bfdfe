// SPDX-License-Identifier: Apache-2.0
// How a finger turns a cap when everything is known: where its tip is, where it should go, and the
// angles for that. It goes back out of touch, presses, and goes around the cap as far as it
// reaches.
#pragma once

#include <array>

#include "engine/model/scene.hpp"

namespace tangere {

/// Angles of a finger: swing, upper, lower [rad].
using FingerAngles = std::array<double, 3>;

/// A cap as a finger sees it: its radius, and where its axis is from the one that the fingers stand
/// around, along the finger's radius and to its left [m].
struct CapSeen {
  double radius = 0, out = 0, left = 0;
};

class CapScript {
 public:
  /// Takes lengths from the scene: all three fingers are like the first.
  explicit CapScript(const Scene& scene);

  /// From the cap to the tip [m]; negative: they would touch.
  [[nodiscard]] double gap(const FingerAngles& q, const CapSeen& cap) const;
  /// Whether a finger presses next, given whether it does now.
  [[nodiscard]] bool presses(const FingerAngles& q, const CapSeen& cap, bool now) const;
  /// Where the angles should go.
  [[nodiscard]] FingerAngles targets(const FingerAngles& q, const CapSeen& cap,
                                     bool pressing) const;

 private:
  /// Of the middle of the tip's sphere: from the cap's axis [m], around it [rad] from where the
  /// finger points.
  struct Place {
    double out, around;
  };
  [[nodiscard]] Place place(const FingerAngles& q, const CapSeen& cap) const;
  /// Where a stroke ends; it begins as far on the other side.
  [[nodiscard]] double end(const CapSeen& cap) const;
  /// Angles at which a tip is there, at the height of the cap's middle.
  [[nodiscard]] FingerAngles angles_at(const Place& place, const CapSeen& cap) const;

  double hip_ = 0, upper_ = 0, lower_ = 0;  // hip from its axis, lengths of the links [m]
  double tip_ = 0;                          // radius of a tip [m]
  double below_ = 0;  // tips work so far below the hip: at the middle of the cap [m]
};

}  // namespace tangere
