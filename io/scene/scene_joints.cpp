// SPDX-License-Identifier: Apache-2.0
// Reads what acts on the joints of a scene file: damping, springs, limits, motors.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/scene/scene_faults.hpp"
#include "io/scene/scene_sections.hpp"

namespace tangere {

namespace {

/// Reads the effects of the dofs that turn, or of those that slide.
JointEffects read_effects(const SceneElement& node, JointType type, bool turns) {
  JointEffects e;
  node.read(e, turns, to_string(type));
  if (!node.has("lim")) return e;
  const std::vector<double> x = node.numbers("lim", 2, turns);
  e.limits = {x[0], x[1]};
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

/// Reads what a motor makes of its control. With scale, u has no unit.
void read_input(const SceneElement& node, bool turns, MotorDescription& motor) {
  const bool position = motor.control == MotorControl::position;
  const Unit sliding = position ? Unit::m : Unit::N, turning = position ? Unit::rad : Unit::N_m;
  const double unit = node.context().factor(turns ? turning : sliding);
  if (node.has("scale")) motor.scale = unit * node.number("scale");
  motor.offset = unit * node.number("offset");
  if (!node.has("u_range")) return;
  const std::vector<double> range = node.numbers("u_range", 2);
  const double u_unit = motor.scale || !position ? 1 : unit;
  motor.u_range = {u_unit * range[0], u_unit * range[1]};
}

/// Reads range and gains of a motor. Its dofs all slide or all turn, except those of a force motor
/// on a free2d joint. There the range's numbers are forces and torques at once.
void read_motor(const SceneElement& node, JointType type, MotorDescription& motor) {
  const bool mixed = type == JointType::free2d, turns = !mixed && dof_turns(type, 0);
  const bool position = motor.control == MotorControl::position;
  const char* const kind = position ? "position" : "force";
  node.check(kind);
  node.read(motor, turns, kind);
  read_input(node, turns, motor);
  if (!position && !motor.scale) motor.D = 0;  // as the published reader, which ignores it
  if (position) motor.timing = static_cast<MotorTiming>(node.word("timing"));
  if (position || motor.scale) {
    motor.low = -MotorDescription::kNoBound;
    motor.high = MotorDescription::kNoBound;
    if (!node.has("ctrl_range")) return;
  }
  const std::vector<double> range = node.numbers("ctrl_range", 2, turns);
  motor.low = range[0], motor.high = range[1];
  if (!mixed) return;
  const std::vector<double> turning = node.numbers("ctrl_range", 2, true);
  motor.turning = {turning[0], turning[1]};
}

void check_driven(const SceneNode& node, JointType type, const MotorDescription& motor) {
  const std::string joint = "joint '" + motor.joint + "' ";
  if (type == JointType::free)
    node.fail(joint +
              "mixes forces and torques; a motor needs a joint of one kind, or a free2d joint");
  if (type == JointType::free2d && motor.control == MotorControl::position)
    node.fail(joint +
              "slides and turns, so its dofs cannot share P and D; expected ctrl=\"force\"");
}

/// Splits names between blanks or, if there is a comma, between commas. A name between commas may
/// have blanks, and nothing needs to follow the last comma. An empty name stays, so that it is
/// reported as unknown.
std::vector<std::string> leaders_of(const std::string& text) {
  if (text.find(',') == std::string::npos) return words_of(text.c_str());
  constexpr const char* kBlanks = " \t\r\n";
  std::vector<std::string> names;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const std::size_t first = std::min(text.find_first_not_of(kBlanks, at), end);
    const bool is_empty = first == end;
    if (is_empty && end == text.size()) break;
    const std::size_t last = is_empty ? first : text.find_last_not_of(kBlanks, end - 1) + 1;
    names.push_back(text.substr(first, last - first));
    at = end + 1;
  }
  return names;
}

}  // namespace

double coordinate_scale(JointType type, int index, const SceneContext& c) {
  return dof_turns(type, index) ? 1 : c.length;
}

void read_joint_effects(const SceneElement& node, JointDescription& joint) {
  const bool mixed = joint.type == JointType::free || joint.type == JointType::free2d;
  static_cast<JointEffects&>(joint) =
      read_effects(node, joint.type, !mixed && dof_turns(joint.type, 0));
  if (joint.type == JointType::fixed) return;
  if (mixed && has_effect(joint)) joint.turning = read_effects(node, joint.type, true);
  node.refuse(joint_fault(joint));
  if (node.has("rest")) joint.rest = read_rest(node, joint.type);
  if (node.has("rest") && joint.stiffness == 0)
    node.warn("'rest' has no effect without 'stiffness'");
  for (const char* name : {"friction_break", "friction_time"})
    if (node.has(name) && !node.has("friction"))
      node.warn(fmt::format("'{}' has no effect without 'friction'", name));
  if (node.has("lim") && joint.limit_stiffness == 0)
    node.warn("'lim' has no effect without 'lim_stiffness'");
}

void read_follower(const SceneElement& node, JointDescription& joint) {
  for (const char* name : {"ratio", "offset", "powers"})
    if (!node.has("follows") && node.has(name))
      node.warn(fmt::format("'{}' has no effect without 'follows'", name));
  if (!node.has("follows")) return;
  joint.follows = leaders_of(node.text("follows"));
  if (joint.follows.empty()) node.fail("follows=\"\"; expected names of joints");
  joint.ratio = node.has("ratio") ? node.numbers("ratio", joint.follows.size())
                                  : std::vector<double>(joint.follows.size(), 1.0);
  joint.offset = node.number("offset", dof_turns(joint.type, 0));
  if (!node.has("powers")) return;
  if (joint.follows.size() != 1)
    node.fail(fmt::format("powers of a joint that follows {}; expected one", joint.follows.size()));
  joint.powers = node.numbers("powers");
  if (joint.powers.empty() || joint.powers.size() > kMostPowers)
    node.fail(
        fmt::format("powers has {} numbers; expected 1 to {}", joint.powers.size(), kMostPowers));
}

void scale_ratios(const Scene& scene, double length, JointDescription& joint) {
  const auto factor = [&](JointType type) { return dof_turns(type, 0) ? 1 : length; };
  for (std::size_t k = 0; k < joint.follows.size(); ++k) {
    const auto leader = std::ranges::find_if(
        scene.links, [&](const LinkDescription& l) { return l.joint.name == joint.follows[k]; });
    if (leader == scene.links.end()) continue;
    const double unit = factor(leader->joint.type);
    double scale = factor(joint.type) / unit;
    joint.ratio[k] *= scale;
    for (double& c : joint.powers) c *= scale /= unit;
  }
}

std::vector<double> control_scales(const Scene& scene, const SceneContext& c) {
  std::vector<double> scales;
  for (const MotorDescription& m : scene.motors)
    for (const LinkDescription& l : scene.links)
      for (int k = 0; l.joint.name == m.joint && k < dof_count(l.joint.type); ++k)
        scales.push_back(m.control == MotorControl::position && !m.scale &&
                                 !dof_turns(l.joint.type, k)
                             ? c.length
                             : 1);
  return scales;
}

int control_count(const Scene& scene) {
  int count = 0;
  for (const MotorDescription& m : scene.motors) count += dofs_driven(scene, m);
  return count;
}

void read_actuators(Scene& scene, const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    MotorDescription motor;
    motor.source = node.source();
    const std::size_t link = node.has("body") ? read_motor_place(scene, node)
                                              : std::size_t(find_joint(scene, node, "joint"));
    const JointType type = scene.links[link].joint.type;
    motor.joint = scene.links[link].joint.name;
    if (!node.has("body")) motor.name = node.text("name", "");
    motor.control = static_cast<MotorControl>(node.word("ctrl"));
    check_driven(node, type, motor);
    read_motor(node, type, motor);
    node.refuse(motor_fault(scene, motor));
    scene.motors.push_back(motor);
  }
}

}  // namespace tangere
