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

constexpr double kDamping = 2;  // of the hand [N s/m, N m s/rad]
constexpr double kTorque = 3;   // at u = 1 [N m]

// Values from searches over 256 and over 128 episodes with seeds that the tests do not use.
constexpr PushGains kViscous{.swing = 0.019,
                             .cone = 1,
                             .rate = 2.36,
                             .fastest = 0.032,
                             .turn_rate = 28,
                             .fastest_turn = 4.8,
                             .lead = 1.18,
                             .most_lead = 1.9,
                             .sideways = 0.152,
                             .here = 0.0585,
                             .grip = 9.6,
                             .press = 0.0006,
                             .slowing = 1.13,
                             .creep = 0.02,
                             .friction = 0.6};
constexpr PushGains kElastic{.swing = 0.006,
                             .cone = 0.471,
                             .rate = 4.86,
                             .fastest = 0.056,
                             .turn_rate = 7.6,
                             .fastest_turn = 16.9,
                             .lead = 0.906,
                             .most_lead = 2.89,
                             .sideways = 0.212,
                             .here = 0.0483,
                             .grip = 10.7,
                             .press = 0.0037,
                             .slowing = 1,
                             .creep = 0.0045,
                             .friction = 0.7};

using Vector2 = std::array<double, 2>;

Vector2 turned(double angle, const Vector2& a) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * a[0] - s * a[1], s * a[0] + c * a[1]};
}
double wrapped(double angle) { return std::remainder(angle, 6.283185307179586); }

}  // namespace

PushScript::PushScript(const Scene& scene, Friction friction)
    : gains_(friction == Friction::elastic ? kElastic : kViscous) {
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
  const PushGains& g = gains_;
  const Vector2 way = {s.goal[0] - s.box[0], s.goal[1] - s.box[1]};
  const double distance = std::hypot(way[0], way[1]);
  // The yaw that the box should have now.
  double yaw = s.goal[2];
  const double along = std::atan2(way[1], way[0]);
  const double ahead = std::cos(along - s.box[2]);
  if (distance > g.here && ahead > 0)
    yaw = along - std::clamp(g.swing * wrapped(s.goal[2] - along), -g.cone, g.cone);
  const double missing = wrapped(yaw - s.box[2]);
  const double turn_rate =
      std::clamp(g.turn_rate * (wrapped(s.box[2] - s.turn) +
                                std::clamp(g.lead * missing, -g.most_lead, g.most_lead)),
                 -g.fastest_turn, g.fastest_turn);
  // A box that went too far can only wait: the finger cannot pull it.
  const double off = std::abs(wrapped(along - s.box[2]));
  const double speed =
      ahead <= 0 ? 0
                 : std::min(g.fastest, g.rate * distance) * std::clamp(g.slowing - off, 0.1, 1.0);
  const double heading = s.box[2] + std::clamp(wrapped(along - s.box[2]), -g.sideways, g.sideways);
  const Vector2 to = {std::cos(heading), std::sin(heading)};
  // The velocity of the pad's place on the face, plus a velocity that brings the pad there.
  const Vector2 slid = turned(s.turn, {s.slide[0] + tip_[0], s.slide[1] + tip_[1]});
  const Vector2 tip = {base_[0] + slid[0], base_[1] + slid[1]};
  const Vector2 arm = turned(s.box[2], {face_[0] + g.press, face_[1]});
  const Vector2 requested = {
      speed * to[0] - turn_rate * arm[1] + g.grip * (s.box[0] + arm[0] - tip[0]),
      speed * to[1] + turn_rate * arm[0] + g.grip * (s.box[1] + arm[1] - tip[1])};
  // In the axes of the hand, which turn: d(slide)/dt = Rᵀ wanted - rate × (slide + tip).
  const Vector2 in_hand = turned(-s.turn, requested);
  const Vector2 rate = {in_hand[0] + turn_rate * (s.slide[1] + tip_[1]),
                        in_hand[1] - turn_rate * (s.slide[0] + tip_[0])};
  // Friction of the ground on the box: a force at the tip, which also turns the hand.
  const double taken = g.friction * std::min(1.0, speed / g.creep);
  const Vector2 ground = turned(-s.turn, {taken * to[0], taken * to[1]});
  const double torque = taken * (slid[0] * to[1] - slid[1] * to[0]);
  return {kDamping * rate[0] + ground[0], kDamping * rate[1] + ground[1],
          (kDamping * turn_rate + torque) / kTorque};
}

}  // namespace tangere
