// SPDX-License-Identifier: Apache-2.0
// What a scene calls for, as `inspect` tells it.
#include <algorithm>

#include "engine/model/compile_joints.hpp"

namespace tangere {

using kernels::JointKind;
using kernels::Link;

void decide_effects(CompiledModel& m) {
  const auto add = [&](const char* name, bool on, std::string reason) {
    m.effects.push_back({name, on, std::move(reason)});
  };
  const auto counted = [](std::size_t n, const std::string& one, const std::string& many) {
    return std::to_string(n) + " " + (n == 1 ? one : many);
  };
  const Vector3& g = m.scene.gravity;
  const bool gravity = g[0] != 0 || g[1] != 0 || g[2] != 0;
  add("gravity", gravity, gravity ? "option gravity is not zero" : "option gravity is zero");
  const bool turning = std::any_of(m.links.begin(), m.links.end(), [](const Link& l) {
    return l.kind == JointKind::spherical || l.kind == JointKind::revolute;
  });
  add("velocity products", turning, turning ? "some joint turns" : "no joint turns");
  const auto joints_with = [&](kernels::JointEffect effect) {
    return std::size_t(
        std::count_if(m.joints.begin(), m.joints.end(), [&](const CompiledJoint& joint) {
          return std::any_of(m.links.begin() + std::max(joint.first_link, 0),
                             m.links.begin() + std::max(joint.first_link, 0) + joint.link_count,
                             [&](const Link& l) { return (l.effects & effect) != 0; });
        }));
  };
  const std::pair<const char*, kernels::JointEffect> of_joints[] = {
      {"joint damping", kernels::kDamped},
      {"joint springs", kernels::kSprung},
      {"joint limits", kernels::kLimited},
      {"armature", kernels::kArmoured}};
  for (const auto& [name, effect] : of_joints) {
    const std::size_t n = joints_with(effect);
    add(name, n > 0, counted(n, "joint", "joints"));
  }
  const auto controls_of = [&](MotorControl control) {
    return std::size_t(
        std::count_if(m.motors.begin(), m.motors.end(),
                      [&](const CompiledMotor& motor) { return motor.control == control; }));
  };
  add("force motors", controls_of(MotorControl::force) > 0,
      counted(controls_of(MotorControl::force), "control", "controls"));
  add("position motors", controls_of(MotorControl::position) > 0,
      counted(controls_of(MotorControl::position), "control", "controls"));
  add("pair contact", !m.pairs.empty(), counted(m.pairs.size(), "pair declared", "pairs declared"));
  add("ground contact", !m.grounds.empty(),
      counted(m.grounds.size(), "body declared", "bodies declared"));
  add("tactile", !m.sensors.empty(),
      counted(m.sensors.size(), "sensor declared", "sensors declared"));
  const std::size_t varying = m.layout.rows - m.layout.parameters;
  add("varying parameters", varying > 0,
      counted(varying, "number varies by environment", "numbers vary by environment"));
}

}  // namespace tangere
