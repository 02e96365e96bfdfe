// SPDX-License-Identifier: Apache-2.0
// A finger swings about the cap's radius and has two links in the plane of the swing. A tip does
// not turn while it goes around the cap. So it rolls on the cap, and its contact moves across the
// hemisphere.
#include "tasks/catalogue/cap_opening_script.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr double kWidest = 0.65;     // limit of a stroke to either side: tips stay apart [rad]
constexpr double kFarthest = 0.046;  // the same along the cap; the smaller limit holds [m]
constexpr double kReached = 0.05;   // a tip this near to the start of a stroke has reached it [rad]
constexpr double kInto = 0.015;     // depth of a pressing tip's target in the cap [m]
constexpr double kAway = 6e-3;      // distance from the cap to which a tip goes back [m]
constexpr double kClear = 2e-3;     // beyond this distance a tip goes back around the cap [m]
constexpr double kTouching = 5e-4;  // below this distance a tip turns the cap [m]
constexpr double kAhead = 0.012;    // its target is then so far ahead of it [m]

/// Largest distance of the contact points from the middle of their hemisphere.
double tip_radius(const BodyDescription& body) {
  const auto* shape = std::get_if<AbstractShape>(&body.shape);
  double square = 0;
  for (std::size_t k = 0; shape && k < shape->contact_points.size(); k += 3) {
    double sum = 0;
    for (std::size_t c = 0; c < 3; ++c)
      sum += std::pow(shape->contact_points[k + c] + body.pose.position[c], 2);
    square = std::max(square, sum);
  }
  return std::sqrt(square);
}

}  // namespace

CapScript::CapScript(const Scene& scene) {
  double height = 0, hip_height = 0;
  for (const LinkDescription& link : scene.links) {
    const Vector3& p = link.joint.pose.position;
    if (link.joint.name == "mount_1") hip_ = std::hypot(p[0], p[1]), hip_height = p[2];
    if (link.joint.name == "lower_1") upper_ = -p[2];
    if (link.joint.name == "tip_1") lower_ = -p[2], tip_ = tip_radius(link.body);
    if (link.joint.name == "bottle" || link.joint.name == "cap") height += p[2];
  }
  below_ = hip_height - height;
}

CapScript::Place CapScript::place(const FingerAngles& q, const CapView& cap) const {
  const double out = hip_ - upper_ * std::sin(q[1]) - lower_ * std::sin(q[1] + q[2]) - cap.out;
  const double down = upper_ * std::cos(q[1]) + lower_ * std::cos(q[1] + q[2]),
               along = down * std::sin(q[0]) - cap.left;
  return {std::hypot(out, along), std::atan2(along, out)};
}

FingerAngles CapScript::angles_at(const Place& place, const CapView& cap) const {
  const double along = place.out * std::sin(place.around) + cap.left;
  const double in = hip_ - place.out * std::cos(place.around) - cap.out;
  const double down = std::hypot(along, below_), reach = std::hypot(in, down);
  const double bend = (reach * reach - upper_ * upper_ - lower_ * lower_) / (2 * upper_ * lower_);
  const double lower = std::acos(std::clamp(bend, -1.0, 1.0));
  const double upper = std::atan2(in, down) -
                       std::atan2(lower_ * std::sin(lower), upper_ + lower_ * std::cos(lower));
  return {std::atan2(along, below_), upper, lower};
}

double CapScript::gap(const FingerAngles& q, const CapView& cap) const {
  return place(q, cap).out - cap.radius - tip_;
}

double CapScript::end(const CapView& cap) const {
  return std::min(kWidest, kFarthest / (cap.radius + tip_));
}

bool CapScript::presses(const FingerAngles& q, const CapView& cap, bool now) const {
  const double around = place(q, cap).around;
  return now ? around < end(cap) : std::abs(around + end(cap)) < kReached;
}

FingerAngles CapScript::targets(const FingerAngles& q, const CapView& cap, bool pressing) const {
  const double around = place(q, cap).around, off = gap(q, cap), middle = cap.radius + tip_;
  if (pressing && off < kTouching) {  // a target inward of the tip and ahead along the cap
    const double inward = middle - kInto;
    return angles_at({std::hypot(inward, kAhead), around + std::atan2(kAhead, inward)}, cap);
  }
  if (pressing) return angles_at({middle - kInto, around}, cap);
  return angles_at({middle + kAway, off > kClear ? -end(cap) : around}, cap);
}

}  // namespace tangere
