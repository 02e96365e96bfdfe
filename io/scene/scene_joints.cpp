// SPDX-License-Identifier: Apache-2.0
// Reads what acts on the joints of a scene file: damping, springs, limits, motors.
#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "engine/model/scene_number.hpp"
#include "io/scene/scene_sections.hpp"

namespace tangere {

namespace {

/// Reads the effects of the dofs that turn, or of those that slide, in SI.
JointEffects effects_in_si(const SceneNode& node, bool turns) {
  const SceneContext& c = node.context();
  JointEffects e;
  for (std::size_t k = 0; k < kJointEffects; ++k) {
    const NumberKind& kind = number_kind(NumberOwner::joint, effect_field(k));
    e[k] = node.not_negative(kind.name, 0.0) * c.factor(kind.unit_of(turns));
  }
  if (node.has("lim")) {
    const std::vector<double> x = node.numbers("lim", 2);
    if (!(x[0] <= x[1]))
      node.fail(fmt::format("lim=\"{} {}\": expected low, then high", x[0], x[1]));
    const double length = turns ? 1 : c.length;
    e.limits = {x[0] * length, x[1] * length};
  }
  return e;
}

/// Reads one number for all dofs, or one for each. A spherical joint's three form a rotation
/// vector.
std::vector<double> read_rest(const SceneNode& node, JointType type) {
  std::vector<double> rest = node.numbers("rest");
  const auto count = std::size_t(dof_count(type));
  if (rest.size() == 1) rest.assign(count, rest[0]);
  if (rest.size() != count)
    node.fail(count == 1
                  ? fmt::format("rest has {} numbers; expected 1", rest.size())
                  : fmt::format("rest has {} numbers; expected 1 or {}", rest.size(), count));
  double square = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (!dof_turns(type, static_cast<int>(k))) rest[k] *= node.context().length;
    if ((type == JointType::spherical || type == JointType::free) &&
        dof_turns(type, static_cast<int>(k)))
      square += rest[k] * rest[k];
  }
  if (!(square < M_PI * M_PI))
    node.fail(fmt::format("rest turns by {} rad; expected a rotation vector shorter than pi",
                          std::sqrt(square)));
  return rest;
}

bool has_effect(const JointEffects& e) {
  for (std::size_t k = 0; k < kJointEffects; ++k)
    if (e[k] != 0) return true;
  return false;
}

/// Reads range and gains of a motor. Its dofs all slide or all turn, except those of a force motor
/// on a free2d joint. There the range's numbers are forces and torques at once.
void read_motor(const SceneNode& node, JointType type, MotorDescription& motor) {
  const SceneContext& c = node.context();
  const bool mixed = type == JointType::free2d, turns = !mixed && dof_turns(type, 0);
  const bool position = motor.control == MotorControl::position;
  std::vector<std::string> used = {"joint", "ctrl", "ctrl_range"}, idle = {"name"};
  for (const char* name : {"P", "D", "timing"}) (position ? used : idle).emplace_back(name);
  node.check_attributes(used, {}, idle);
  if (position) {
    const auto factor = [&](NumberField field) {
      return c.factor(number_kind(NumberOwner::motor, field).unit_of(turns));
    };
    motor.P = node.not_negative("P") * factor(NumberField::P);
    motor.D = node.not_negative("D", 0.0) * factor(NumberField::D);
    motor.timing =
        node.choice("timing", {"end", "start"}, 0) == 1 ? MotorTiming::start : MotorTiming::end;
    motor.high = std::numeric_limits<double>::infinity();
    motor.low = -motor.high;
    if (!node.has("ctrl_range")) return;
  }
  const std::vector<double> range = node.numbers("ctrl_range", 2);
  if (position && !(range[0] <= range[1]))
    node.fail(fmt::format("ctrl_range=\"{} {}\": expected low, then high", range[0], range[1]));
  motor.low = range[0] * (turns ? c.torque : c.force);
  motor.high = range[1] * (turns ? c.torque : c.force);
  if (mixed) motor.turning = {range[0] * c.torque, range[1] * c.torque};
}

void check_driven(const SceneNode& node, JointType type, const MotorDescription& motor) {
  const std::string joint = "joint '" + motor.joint + "' ";
  if (type == JointType::fixed) node.fail(joint + "is fixed; a motor needs a joint that moves");
  if (type == JointType::free)
    node.fail(joint +
              "mixes forces and torques; a motor needs a joint of one kind, or a free2d joint");
  if (type == JointType::free2d && motor.control == MotorControl::position)
    node.fail(joint +
              "slides and turns, so its dofs cannot share P and D; expected ctrl=\"force\"");
}

}  // namespace

double coordinate_scale(JointType type, int index, const SceneContext& c) {
  return c.factor(coordinate_unit(type, index));
}

void read_joint_effects(const SceneNode& node, JointDescription& joint) {
  const bool mixed = joint.type == JointType::free || joint.type == JointType::free2d;
  if (joint.type == JointType::fixed) {
    joint.damping = node.not_negative("damping", 0.0) *
                    node.context().damping_force;  // checked even if nothing moves
    return;
  }
  static_cast<JointEffects&>(joint) = effects_in_si(node, !mixed && dof_turns(joint.type, 0));
  if (mixed && has_effect(joint)) joint.turning = effects_in_si(node, true);
  if (node.has("rest")) joint.rest = read_rest(node, joint.type);
  if (node.has("rest") && joint.stiffness == 0)
    node.warn("'rest' has no effect without 'stiffness'");
  if (node.has("lim") && joint.limit_stiffness == 0)
    node.warn("'lim' has no effect without 'lim_stiffness'");
}

std::vector<double> control_scales(const Scene& scene, const SceneContext& c) {
  std::vector<double> scales;
  for (const MotorDescription& m : scene.motors)
    for (const LinkDescription& l : scene.links)
      for (int k = 0; l.joint.name == m.joint && k < dof_count(l.joint.type); ++k)
        scales.push_back(
            m.control == MotorControl::position && !dof_turns(l.joint.type, k) ? c.length : 1);
  return scales;
}

int control_count(const Scene& scene) {
  int count = 0;
  for (const MotorDescription& m : scene.motors)
    for (const LinkDescription& l : scene.links)
      if (l.joint.name == m.joint) count += dof_count(l.joint.type);
  return count;
}

void read_actuators(Scene& scene, const SceneNode& section) {
  section.check_attributes({});
  for (const SceneNode& node : section.children({"motor"})) {
    MotorDescription motor;
    motor.source = node.source();
    const JointType type = scene.links[std::size_t(find_joint(scene, node, "joint"))].joint.type;
    motor.joint = node.text("joint");
    motor.control = node.choice("ctrl", {"force", "position"}) == 1 ? MotorControl::position
                                                                    : MotorControl::force;
    check_driven(node, type, motor);
    for (const MotorDescription& other : scene.motors)
      if (other.joint == motor.joint) node.fail("joint '" + motor.joint + "' already has a motor");
    read_motor(node, type, motor);
    scene.motors.push_back(motor);
  }
}

}  // namespace tangere
