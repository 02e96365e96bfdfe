// SPDX-License-Identifier: Apache-2.0
// A finger is a swing about its radius and two links in the plane that it swings. A cap rolls along a flat pad that moves
// past it: a stroke is no longer than the pad is wide, and turns the cap by less than it must.
#include "tasks/cap_opening_script.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr double kUpright = 0.3;                // upper + lower of a pad that stands upright [rad]
constexpr double kBack = -0.012, kEnd = 0.012;  // of a stroke [m]
constexpr double kReached = 2e-3;               // [m]
constexpr double kInto = 0.03;                  // a pressing pad aims so far into the cap: as hard as an action can [m]
constexpr double kAway = 6e-3;                  // a pad goes back so far from the cap [m]
constexpr double kClear = 2e-3;                 // and moves along when it is so far away [m]
constexpr double kTouching = 5e-4;              // closer it moves along the cap [m]
constexpr double kAhead = 0.013;                // along the stroke, as far ahead of itself as an action reaches [m]

}  // namespace

CapScript::CapScript(const Scene& scene) {
  double height = 0, hip_height = 0;
  for (const LinkDescription& link : scene.links) {
    const Vector3& p = link.joint.pose.position;
    if (link.joint.name == "mount_1") hip_ = std::hypot(p[0], p[1]), hip_height = p[2];
    if (link.joint.name == "lower_1") upper_ = -p[2];
    if (link.joint.name == "tip_1") {
      lower_ = -p[2];
      if (const auto* pad = std::get_if<CuboidShape>(&link.body.shape))
        half_height_ = pad->size[0] / 2, half_thickness_ = pad->size[2] / 2;
    }
    if (link.joint.name == "bottle" || link.joint.name == "cap") height += p[2];
    if (link.joint.name != "cap") continue;
    if (const auto* cap = std::get_if<CylinderShape>(&link.body.shape)) radius_ = cap->radius;
  }
  below_ = hip_height - height;
}

std::array<double, 3> CapScript::place(const FingerAngles& q) const {
  const double out = hip_ - upper_ * std::sin(q[1]) - lower_ * std::sin(q[1] + q[2]);
  const double down = upper_ * std::cos(q[1]) + lower_ * std::cos(q[1] + q[2]);
  return {out, down * std::sin(q[0]), down * std::cos(q[0])};
}

FingerAngles CapScript::angles_at(const std::array<double, 3>& place) const {
  const double in = hip_ - place[0], down = std::hypot(place[1], place[2]), reach = std::hypot(in, down);
  const double bend = (reach * reach - upper_ * upper_ - lower_ * lower_) / (2 * upper_ * lower_);
  const double lower = std::acos(std::clamp(bend, -1.0, 1.0));
  const double upper = std::atan2(in, down) - std::atan2(lower_ * std::sin(lower), upper_ + lower_ * std::cos(lower));
  return {std::atan2(place[1], place[2]), upper, lower};
}

double CapScript::gap(const FingerAngles& q) const {
  const double tilt = q[1] + q[2] - kUpright;
  return place(q)[0] - half_thickness_ * std::cos(tilt) - half_height_ * std::abs(std::sin(tilt)) - radius_;
}

bool CapScript::presses(const FingerAngles& q, bool now) const {
  const double along = place(q)[1];
  return now ? along < kEnd : along < kBack + kReached && along > kBack - kReached;
}

FingerAngles CapScript::targets(const FingerAngles& q, bool pressing) const {
  const std::array<double, 3> at = place(q);
  const double off = gap(q), face = radius_ + half_thickness_;
  if (pressing) return angles_at({face - kInto, off < kTouching ? at[1] + kAhead : kBack, below_});
  return angles_at({face + kAway, off > kClear ? kBack : at[1], below_});
}

}  // namespace tangere
