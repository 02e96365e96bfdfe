// SPDX-License-Identifier: Apache-2.0
// A flat pad on a flat face holds the box as long as it pushes nearly along the face's normal. If
// it pushes sideways, the box turns away. So the script turns the face towards the goal and, near
// the goal, to the goal's own yaw. The hand turns ahead of the box. Then one edge of the pad pushes
// harder and turns the box.
#include "tasks/catalogue/box_pushing_script.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

// Values from a search over 256 episodes with a seed that the tests do not use.
constexpr double
    kCone = 1,
    kSwing = 0.019;  // the face looks past the goal by kSwing rad per rad of its yaw, at most kCone
constexpr double kRate = 2.36, kFastest = 0.032;      // approach to the goal [1/s], [m/s]
constexpr double kTurnRate = 28, kFastestTurn = 4.8;  // of the hand [1/s], [rad/s]
constexpr double kLead = 1.18,
                 kMostLead = 1.9;    // lead of the hand: per rad that the box lacks, at most [rad]
constexpr double kSideways = 0.152;  // largest angle between push and the box's x axis [rad]
constexpr double kHere = 0.0585;     // [m]: nearer than this, the box turns to the goal's yaw
constexpr double kGrip = 9.6;        // tip to face [1/s]
constexpr double kPress = 0.0006;    // depth of the tip's target in the face [m]
constexpr double kSlowing = 1.13;    // [rad]: if the way is farther off, the box is slower
constexpr double kCreep = 0.02;      // [m/s]: below this speed the ground resists less
constexpr double kFriction = 0.6;    // friction of the ground [N]; its limit μ m g is 0.59 N
constexpr double kDamping = 2;       // of the hand [N s/m, N m s/rad]
constexpr double kTorque = 3;        // at u = 1 [N m]

using Vector2 = std::array<double, 2>;

Vector2 turned(double angle, const Vector2& a) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * a[0] - s * a[1], s * a[0] + c * a[1]};
}
double wrapped(double angle) { return std::remainder(angle, 6.283185307179586); }

}  // namespace

PushScript::PushScript(const Scene& scene) {
  for (const LinkDescription& link : scene.links) {
    const Vector3& p = link.joint.pose.position;
    if (link.joint.name == "hand_turn") base_ = {p[0], p[1]};
    if (link.joint.name == "box_slide") box_rest_ = {p[0], p[1]};
  }
  for (const EndEffectorDescription& v : scene.end_effectors) {
    if (v.name == "tip") tip_ = {v.position[0], v.position[1]};
    if (v.name == "face") face_ = {v.position[0], v.position[1]};
  }
}

std::array<double, 3> PushScript::controls(const PushState& s) const {
  const Vector2 way = {s.goal[0] - s.box[0], s.goal[1] - s.box[1]};
  const double distance = std::hypot(way[0], way[1]);
  // The yaw that the box should have now.
  double yaw = s.goal[2];
  const double along = std::atan2(way[1], way[0]);
  const double ahead = std::cos(along - s.box[2]);
  if (distance > kHere && ahead > 0)
    yaw = along - std::clamp(kSwing * wrapped(s.goal[2] - along), -kCone, kCone);
  const double missing = wrapped(yaw - s.box[2]);
  const double turn_rate = std::clamp(
      kTurnRate * (wrapped(s.box[2] - s.turn) + std::clamp(kLead * missing, -kMostLead, kMostLead)),
      -kFastestTurn, kFastestTurn);
  // A box that went too far can only wait: the finger cannot pull it.
  const double off = std::abs(wrapped(along - s.box[2]));
  const double speed =
      ahead <= 0 ? 0 : std::min(kFastest, kRate * distance) * std::clamp(kSlowing - off, 0.1, 1.0);
  const double heading = s.box[2] + std::clamp(wrapped(along - s.box[2]), -kSideways, kSideways);
  const Vector2 to = {std::cos(heading), std::sin(heading)};
  // The velocity of the pad's place on the face, plus a velocity that brings the pad there.
  const Vector2 slid = turned(s.turn, {s.slide[0] + tip_[0], s.slide[1] + tip_[1]});
  const Vector2 tip = {base_[0] + slid[0], base_[1] + slid[1]};
  const Vector2 arm = turned(s.box[2], {face_[0] + kPress, face_[1]});
  const Vector2 wanted = {
      speed * to[0] - turn_rate * arm[1] + kGrip * (s.box[0] + arm[0] - tip[0]),
      speed * to[1] + turn_rate * arm[0] + kGrip * (s.box[1] + arm[1] - tip[1])};
  // In the axes of the hand, which turn: d(slide)/dt = Rᵀ wanted - rate × (slide + tip).
  const Vector2 in_hand = turned(-s.turn, wanted);
  const Vector2 rate = {in_hand[0] + turn_rate * (s.slide[1] + tip_[1]),
                        in_hand[1] - turn_rate * (s.slide[0] + tip_[0])};
  // Friction of the ground on the box: a force at the tip, which also turns the hand.
  const double taken = kFriction * std::min(1.0, speed / kCreep);
  const Vector2 ground = turned(-s.turn, {taken * to[0], taken * to[1]});
  const double torque = taken * (slid[0] * to[1] - slid[1] * to[0]);
  return {kDamping * rate[0] + ground[0], kDamping * rate[1] + ground[1],
          (kDamping * turn_rate + torque) / kTorque};
}

}  // namespace tangere
