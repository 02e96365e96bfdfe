// SPDX-License-Identifier: Apache-2.0
// Joints, motors and loops of a scene as text and as JSON.
#include "apps/inspect_joints.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/sense/loop_readings.hpp"
#include "engine/step/batch.hpp"

namespace tangere::apps {
namespace {

struct Named {
  std::string joint;
  const JointEffects* effects;
  const JointDescription* leaders;
  const std::vector<double>* rest;
};

bool any(const JointEffects& e) {
  for (std::size_t k = 0; k < kJointEffects; ++k)
    if (e.acts(k)) return true;
  return false;
}

/// Joints that have effects. Dofs that turn get their own line if their effects differ.
std::vector<Named> named_effects(const Scene& scene) {
  std::vector<Named> list;
  for (const LinkDescription& l : scene.links) {
    const JointDescription& j = l.joint;
    if (j.type == JointType::fixed) continue;
    if (any(j) || !j.follows.empty())
      list.push_back({j.turning ? j.name + " (sliding)" : j.name, &j, &j, &j.rest});
    if (j.turning && any(*j.turning))
      list.push_back({j.name + " (turning)", &*j.turning, &j, &j.rest});
  }
  return list;
}

std::string range_text(const MotorDescription& m) {
  if (std::isinf(m.low) && std::isinf(m.high)) return "no range";
  return fmt::format("range {:.6g} {:.6g}", m.low, m.high);
}

std::string force_text(const std::string& joint, double low, double high) {
  return fmt::format("  {}: force, u from -1 to 1 is {:.6g} to {:.6g}\n", joint, low, high);
}

}  // namespace

Json joint_effects_json(const Scene& scene) {
  Json out = Json::array();
  for (const Named& n : named_effects(scene)) {
    const JointEffects& e = *n.effects;
    out.push_back({{"joint", n.joint},
                   {"damping", e.damping},
                   {"armature", e.armature},
                   {"stiffness", e.stiffness},
                   {"rest", e.stiffness != 0 && !n.rest->empty() ? Json(*n.rest) : Json()},
                   {"limits", e.limits ? Json(*e.limits) : Json()},
                   {"lim_stiffness", e.limit_stiffness},
                   {"friction", e.friction},
                   {"follows", n.leaders->follows},
                   {"ratio", n.leaders->ratio},
                   {"offset", n.leaders->offset},
                   {"powers", n.leaders->powers}});
  }
  return out;
}

std::string joint_effects_text(const Scene& scene) {
  const std::vector<Named> list = named_effects(scene);
  std::string text = fmt::format("joint effects ({})\n", list.size());
  for (const Named& n : list) {
    const JointEffects& e = *n.effects;
    std::vector<std::string> parts;
    if (e.damping != 0) parts.push_back(fmt::format("damping {:.6g}", e.damping));
    if (e.armature != 0) parts.push_back(fmt::format("armature {:.6g}", e.armature));
    if (e.stiffness != 0)
      parts.push_back(n.rest->empty() ? fmt::format("stiffness {:.6g}", e.stiffness)
                                      : fmt::format("stiffness {:.6g} about {:.6g}", e.stiffness,
                                                    fmt::join(*n.rest, " ")));
    if (e.friction != 0) parts.push_back(fmt::format("dry friction {:.6g}", e.friction));
    if (e.limits && e.limit_stiffness != 0)
      parts.push_back(fmt::format("limits {:.6g} {:.6g} of stiffness {:.6g}", (*e.limits)[0],
                                  (*e.limits)[1], e.limit_stiffness));
    const JointDescription& d = *n.leaders;
    for (std::size_t k = 0; k < d.follows.size(); ++k)
      parts.push_back(fmt::format("follows {} by {:.6g}", d.follows[k], d.ratio[k]));
    if (!d.powers.empty()) parts.push_back(fmt::format("powers {:.6g}", fmt::join(d.powers, " ")));
    if (d.offset != 0) parts.push_back(fmt::format("offset {:.6g}", d.offset));
    text += fmt::format("  {}: {}\n", n.joint, fmt::join(parts, ", "));
  }
  return text;
}

Json motors_json(const Scene& scene) {
  Json out = Json::array();
  for (const MotorDescription& m : scene.motors) {
    const bool position = m.control == MotorControl::position;
    Json motor = {{"joint", m.joint},
                  {"control", position ? "position" : "force"},
                  {"range", Json::array({finite(m.low), finite(m.high)})}};
    if (m.turning) motor["turning_range"] = *m.turning;
    if (m.scale) motor["scale"] = *m.scale, motor["offset"] = m.offset;
    if (!position && m.D > 0) motor["D"] = m.D;
    if (position) {
      motor["P"] = m.P;
      motor["D"] = m.D;
      motor["timing"] = m.timing == MotorTiming::end ? "end" : "start";
    }
    out.push_back(motor);
  }
  return out;
}

std::string motors_text(const Scene& scene) {
  std::string text = fmt::format("motors ({})\n", scene.motors.size());
  for (const MotorDescription& m : scene.motors) {
    if (m.control == MotorControl::force && m.scale) {
      text += fmt::format("  {}: force {:.6g} u + {:.6g}{}, {}\n", m.joint, *m.scale, m.offset,
                          m.D > 0 ? fmt::format(" - {:.6g} v", m.D) : "", range_text(m));
    } else if (m.control == MotorControl::force) {
      text += force_text(m.turning ? m.joint + " (sliding)" : m.joint, m.low, m.high);
      if (m.turning) text += force_text(m.joint + " (turning)", (*m.turning)[0], (*m.turning)[1]);
    } else {
      text +=
          fmt::format("  {}: position, P {:.6g}, D {:.6g}, {}, from the {} of the step\n", m.joint,
                      m.P, m.D, range_text(m), m.timing == MotorTiming::end ? "end" : "start");
    }
  }
  return text;
}

namespace {

const char* kind_of(const LoopDescription& loop) { return loop.weld ? "weld" : "connect"; }
std::string second_of(const LoopDescription& loop) {
  return loop.body2.empty() ? "the world" : loop.body2;
}

}  // namespace

Json loops_json(const Model& model) {
  Json out = Json::array();
  if (!model.has_loops()) return out;
  const std::vector<LoopReading> readings = loop_readings(model, Batch(model, 1, 0), 0);
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const LoopDescription& d = model.scene().loops[k];
    Json loop = {{"name", d.name},           {"kind", kind_of(d)},
                 {"body1", d.body1},         {"body2", d.body2.empty() ? Json() : Json(d.body2)},
                 {"stiffness", d.stiffness}, {"damping", d.damping},
                 {"gap", readings[k].gap}};
    if (d.weld) {
      loop["turning_stiffness"] = d.turning_stiffness;
      loop["turning_damping"] = d.turning_damping;
      loop["turn"] = readings[k].turn;
    }
    out.push_back(loop);
  }
  return out;
}

namespace {

std::string transmission_text(const TransmissionDescription& d) {
  if (d.kind == TransmissionDescription::Kind::path)
    return fmt::format("length of a path of {} parts", d.path.size());
  return fmt::format("force {:.6g} and torque {:.6g} on {}", fmt::join(d.force, " "),
                     fmt::join(d.torque, " "), d.body);
}

}  // namespace

Json transmissions_json(const Model& model) {
  Json out = Json::array();
  const Batch batch(model, 1, 0);
  std::vector<double> q(std::size_t(model.nq()));
  batch.get_q(0, q);
  for (const TransmissionDescription& d : model.scene().transmissions) {
    const auto at = std::ranges::find_if(
        model.q_names(), [&](const std::string& name) { return name.starts_with(d.joint + "."); });
    const bool path = d.kind == TransmissionDescription::Kind::path;
    Json one = {{"joint", d.joint},
                {"kind", path ? "path" : "wrench"},
                {"start", q[std::size_t(at - model.q_names().begin())]}};
    if (!path) one.update({{"body", d.body}, {"force", d.force}, {"torque", d.torque}});
    out.push_back(one);
  }
  return out;
}

std::string transmissions_text(const Model& model) {
  const Json all = transmissions_json(model);
  if (all.empty()) return "";
  std::string text = fmt::format("transmissions ({})\n", all.size());
  for (std::size_t k = 0; k < all.size(); ++k)
    text += fmt::format("  {}: {}, {:.6g} at the start\n", all[k]["joint"].get<std::string>(),
                        transmission_text(model.scene().transmissions[k]),
                        all[k]["start"].get<double>());
  return text;
}

std::string loops_text(const Model& model) {
  if (!model.has_loops()) return "";
  const std::vector<LoopReading> readings = loop_readings(model, Batch(model, 1, 0), 0);
  std::string text = fmt::format("loops ({})\n", readings.size());
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const LoopDescription& d = model.scene().loops[k];
    text += fmt::format("  {}: {} of {} and {}, stiffness {:.6g}, damping {:.6g}", d.name,
                        kind_of(d), d.body1, second_of(d), d.stiffness, d.damping);
    if (d.weld)
      text += fmt::format(", turning {:.6g}, {:.6g}", d.turning_stiffness, d.turning_damping);
    text += fmt::format(", at the start open by {:.3g} m", readings[k].gap);
    text += d.weld ? fmt::format(" and {:.3g} rad\n", readings[k].turn) : "\n";
  }
  return text + '\n';
}

}  // namespace tangere::apps
