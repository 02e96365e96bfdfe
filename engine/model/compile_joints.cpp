// SPDX-License-Identifier: Apache-2.0
// Joints become chains of elementary links, with coordinates, effects, motors and a starting state.
#include "engine/model/compile_joints.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/model/compile_followers.hpp"
#include "engine/model/compile_transmissions.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"

namespace tangere {

using kernels::Frame;
using kernels::JointKind;
using kernels::Link;
using kernels::Mat3;
using kernels::Vec3;

namespace {

bool is_identity(const Frame<double>& f) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (f.R.m[i][j] != (i == j ? 1.0 : 0.0)) return false;
  return f.p.x == 0 && f.p.y == 0 && f.p.z == 0;
}

void name_coordinates(CompiledModel& m, const JointDescription& d) {
  std::vector<const char*> q, v;
  switch (d.type) {
    case JointType::fixed: break;
    case JointType::revolute: q = {"angle"}, v = {"rate"}; break;
    case JointType::prismatic: q = {"position"}, v = {"rate"}; break;
    case JointType::planar: q = {"axis0", "axis1"}, v = {"v0", "v1"}; break;
    case JointType::free2d: q = {"x", "y", "angle"}, v = {"vx", "vy", "rate"}; break;
    case JointType::translational:
    case JointType::free: q = {"x", "y", "z"}, v = {"vx", "vy", "vz"}; [[fallthrough]];
    case JointType::spherical:
      if (d.type == JointType::translational) break;
      q.insert(q.end(), {"qw", "qx", "qy", "qz"});
      v.insert(v.end(), {"wx", "wy", "wz"});
      break;
  }
  const Attribute& rate = number_kind(NumberOwner::joint, NumberField::v);
  for (std::size_t k = 0; k < q.size(); ++k) {
    m.q_names.push_back(d.name + "." + q[k]);
    m.q_units.emplace_back(coordinate_unit(d.type, static_cast<int>(k)));
  }
  for (std::size_t k = 0; k < v.size(); ++k) {
    m.v_names.push_back(d.name + "." + v[k]);
    m.v_units.emplace_back(to_string(rate.unit_of(dof_turns(d.type, static_cast<int>(k)))));
  }
}

/// Returns the effects that apply to one dof of a joint.
const JointEffects& joint_effects_of_dof(const JointDescription& d, int k) {
  return d.turning && dof_turns(d.type, k) ? *d.turning : d;
}

/// Flag and storage of an effect in kernels, in the order of effect_field().
struct EffectOfDof {
  kernels::Parameter kernels::DofEffects::*number;
  kernels::JointEffect flag;
};
constexpr EffectOfDof kEffectsOfDof[kJointEffects] = {
    {&kernels::DofEffects::damping, kernels::kDamping},
    {&kernels::DofEffects::armature, kernels::kArmature},
    {&kernels::DofEffects::stiffness, kernels::kSpring},
    {&kernels::DofEffects::limit_stiffness, kernels::kLimit},
    {&kernels::DofEffects::friction, kernels::kDryFriction}};

kernels::DofEffects dof_effects(const JointEffects& e, double rest, bool turns) {
  constexpr double kNone = HUGE_VAL;
  kernels::DofEffects out{};
  for (std::size_t k = 0; k < kJointEffects; ++k) out.*kEffectsOfDof[k].number = {e[k], -1};
  out.P = out.D = {0, -1};
  out.rest = rest;
  const auto [low, high] = e.limits.value_or(std::array{-kNone, kNone});
  out.low = low;
  out.high = high;
  out.force_low = -kNone;
  out.force_high = kNone;
  out.friction_rate = 1 / (e.friction_break > 0 ? e.friction_break : default_friction_break(turns));
  out.friction_time = e.friction_time;
  return out;
}

std::uint8_t flags_of(const JointEffects& e) {
  int flags = 0;
  for (std::size_t k = 0; k < kJointEffects; ++k)
    if (e.acts(k)) flags |= kEffectsOfDof[k].flag;
  return static_cast<std::uint8_t>(flags);
}

}  // namespace

int link_of_dof(const CompiledModel& m, int dof) {
  for (int i = 0;; ++i)
    if (dof < m.links[std::size_t(i)].v + kernels::dofs(m.links[std::size_t(i)].kind)) return i;
}

CompiledJoint add_joint(CompiledModel& m, const JointDescription& d, int parent,
                        const Frame<double>& frame) {
  CompiledJoint joint;
  joint.q = m.nq;
  joint.v = m.nv;
  joint.first_link = static_cast<int>(m.links.size());
  joint.frame = kIdentityFrame;
  const Vec3<double> x = {1, 0, 0}, y = {0, 1, 0}, z = {0, 0, 1};
  const Vec3<double> axis0 = vec3_of(d.axis0), axis1 = vec3_of(d.axis1);
  // Appends an elementary link; only the first carries the joint's rest pose.
  const auto add = [&](JointKind kind, const Vec3<double>& axis) {
    const bool first = joint.link_count == 0;
    const Frame<double>& at = first ? frame : kIdentityFrame;
    const int up = first ? parent : joint.link;
    const bool slides = kernels::slides(kind), steady = up < 0 || m.links[up].never_rotates;
    const bool rotated = !is_identity({at.R, {0, 0, 0}}), turned = !slides || rotated;
    const bool placed = slides || !is_identity({kIdentityFrame.R, at.p});
    Link link{up,
              kind,
              m.nq,
              m.nv,
              axis,
              at,
              rotated,
              turned,
              placed,
              steady,
              steady && slides,
              false,
              0,
              0,
              {0, 0, 0},
              kernels::zero33<double>()};
    m.nq += kernels::coordinates(kind);
    m.nv += kernels::dofs(kind);
    joint.link = static_cast<int>(m.links.size());
    m.links.push_back(link);
    ++joint.link_count;
  };
  switch (d.type) {
    case JointType::fixed:
      joint.first_link = -1;
      joint.link = parent;
      joint.frame = frame;
      break;
    case JointType::revolute: add(JointKind::revolute, axis0); break;
    case JointType::prismatic: add(JointKind::prismatic, axis0); break;
    case JointType::planar:
      add(JointKind::prismatic, axis0);
      add(JointKind::prismatic, axis1);
      break;
    case JointType::translational: add(JointKind::translational, x); break;
    case JointType::free2d:
      add(JointKind::prismatic, x);
      add(JointKind::prismatic, y);
      add(JointKind::revolute, z);
      break;
    case JointType::spherical: add(JointKind::spherical, x); break;
    case JointType::free:
      add(JointKind::translational, x);
      add(JointKind::spherical, x);
      break;
  }
  name_coordinates(m, d);
  return joint;
}

void compile_joint_effects(CompiledModel& m) {
  m.dof_effects.resize(std::size_t(m.nv));
  for (std::size_t i = 0; i < m.scene.links.size(); ++i) {
    const JointDescription& d = m.scene.links[i].joint;
    const int count = dof_count(d.type);
    for (int k = 0; k < count; ++k) {
      const int dof = m.joints[i].v + k;
      const JointEffects& e = joint_effects_of_dof(d, k);
      m.dof_effects[std::size_t(dof)] =
          dof_effects(e, d.rest.empty() ? 0 : d.rest[std::size_t(k)], dof_turns(d.type, k));
      m.links[std::size_t(link_of_dof(m, dof))].effects |= flags_of(e);
    }
  }
}

void compile_dry_friction(CompiledModel& m) {
  for (const Link& link : m.links)
    for (int k = 0; k < kernels::dofs(link.kind); ++k) {
      const kernels::Parameter& bound = m.dof_effects[std::size_t(link.v + k)].friction;
      if (bound.value != 0 || bound.row >= 0) m.dry_dofs.push_back({link.v + k, link.q + k});
    }
  m.taped_points += static_cast<int>(m.dry_dofs.size());
}

void compile_motors(CompiledModel& m, const NameIndex& joints) {
  for (const MotorDescription& d : m.scene.motors) {
    const auto i = std::size_t(joints.find("joint", d.joint, d.source));
    const JointType type = m.scene.links[i].joint.type;
    for (int k = 0; k < dof_count(type); ++k) {
      const int dof = m.joints[i].v + k, at = link_of_dof(m, dof);
      Link& link = m.links[std::size_t(at)];
      const auto [low, high] =
          d.turning && dof_turns(type, k) ? *d.turning : std::array{d.low, d.high};
      m.motors.push_back({dof,
                          low,
                          high,
                          d.control,
                          d.timing,
                          at,
                          dof - link.v,
                          {d.P, -1},
                          {d.D, -1},
                          d.maps(),
                          d.scale.value_or(1),
                          d.offset,
                          d.u_range[0],
                          d.u_range[1],
                          d.acts_at_end()});
      const std::string& rate = m.v_names[std::size_t(dof)];
      m.u_names.push_back(d.name.empty()         ? rate
                          : dof_count(type) == 1 ? d.name
                                                 : d.name + rate.substr(d.joint.size()));
      const bool position = d.control == MotorControl::position;
      m.u_units.emplace_back(!position || d.scale ? "1" : dof_turns(type, k) ? "rad" : "m");
      if (!d.acts_at_end()) continue;
      link.effects |= kernels::kPositionServo;
      kernels::DofEffects& e = m.dof_effects[std::size_t(dof)];
      e.P = {position ? d.P : 1, -1};
      e.D = {d.D, -1};
      e.q_apart = position ? 0 : 1;
      e.force_low = low;
      e.force_high = high;
    }
  }
  m.nu = static_cast<int>(m.motors.size());
}

void compile_initial_state(CompiledModel& m, const NameIndex& joints) {
  m.initial_q.assign(m.nq, 0);
  m.initial_v.assign(m.nv, 0);
  for (const Link& link : m.links)
    if (link.kind == JointKind::spherical) m.initial_q[link.q] = 1;
  for (const InitialState& d : m.scene.initial) {
    const int i = joints.find("joint", d.joint, d.source);
    const JointType type = m.scene.links[i].joint.type;
    const auto copy = [&](const char* what, const std::vector<double>& from, int count,
                          double* to) {
      if (from.empty()) return;
      if (from.size() != std::size_t(count))
        throw InputError(d.source.prefix() + "initial " + what + " of joint '" + d.joint +
                         "' has " + std::to_string(from.size()) + " values; expected " +
                         std::to_string(count));
      std::copy(from.begin(), from.end(), to);
    };
    copy("q", d.q, position_count(type), m.initial_q.data() + m.joints[i].q);
    copy("v", d.v, dof_count(type), m.initial_v.data() + m.joints[i].v);
  }
  place_initial_followers(m);
  place_initial_transmissions(m);
}

void vary_joint(CompiledModel& m, int joint, const RandomizationDescription& d, int row) {
  const NumberField field = d.number.field;
  const CompiledJoint& compiled = m.joints[std::size_t(joint)];
  const JointDescription& of = m.scene.links[std::size_t(joint)].joint;
  if (d.number.owner == NumberOwner::motor) {
    const bool P = field == NumberField::P;
    for (CompiledMotor& motor : m.motors) {
      const int k = motor.dof - compiled.v;
      const bool has = motor.control == MotorControl::position || (motor.at_end && !P);
      if (!has || k < 0 || k >= dof_count(of.type)) continue;
      kernels::DofEffects& e = m.dof_effects[std::size_t(motor.dof)];
      (P ? motor.P : motor.D).row = row;
      (P ? e.P : e.D).row = row;
    }
    return;
  }
  const std::size_t effect = effect_index(field);
  for (int k = 0; k < dof_count(of.type); ++k) {
    const int dof = compiled.v + k;
    (m.dof_effects[std::size_t(dof)].*kEffectsOfDof[effect].number).row = row;
    m.links[std::size_t(link_of_dof(m, dof))].effects |= kEffectsOfDof[effect].flag;
  }
}

namespace {

/// Mass, mass times centre, and inertia about the origin, of a link and all that it carries.
struct Composite {
  double mass = 0;
  Vec3<double> moment{0, 0, 0};
  Mat3<double> inertia{};

  /// Adds what a link carries, which is placed in this one's frame.
  void add(const Composite& of, const kernels::Frame<double>& frame) {
    const Vec3<double> p = frame.p, h = frame.R * of.moment;
    // -Σ m [x + p]² = I - [h][p] - [p][h] - m [p]²
    inertia = inertia + frame.R * of.inertia * transpose(frame.R) -
              (skew(h) * skew(p) + skew(p) * skew(h) + of.mass * (skew(p) * skew(p)));
    moment += h + of.mass * p;
    mass += of.mass;
  }
};

/// Those of all links where joints are at rest.
std::vector<Composite> composites(const CompiledModel& m) {
  std::vector<Composite> out;
  for (const kernels::Link& link : m.links)
    out.push_back({link.mass, link.mass_times_com, link.inertia});
  for (std::size_t i = m.links.size(); i-- > 0;)
    if (m.links[i].parent >= 0) out[std::size_t(m.links[i].parent)].add(out[i], m.links[i].frame);
  return out;
}

/// Whether a joint that turns moves a moment of inertia.
bool turns_inertia(const CompiledModel& m, const kernels::Link& link, const Composite& of) {
  constexpr double kTraceRounding = 1e-13;  // relative
  const Mat3<double>& I = of.inertia;
  const double least = kTraceRounding * (I.m[0][0] + I.m[1][1] + I.m[2][2]);
  const auto armature = [&](int k) {
    return m.dof_effects[std::size_t(link.v + k)].armature.value - least;
  };
  if (link.kind == kernels::JointKind::revolute)
    return dot(link.axis, I * link.axis) + armature(0) > 0;
  return link.kind != kernels::JointKind::spherical ||
         is_inertia({I.m[0][0] + armature(0), I.m[0][1], I.m[0][2], I.m[1][1] + armature(1),
                     I.m[1][2], I.m[2][2] + armature(2)});
}

}  // namespace

void check_masses(const CompiledModel& m) {
  const std::vector<Composite> carried = composites(m);
  const auto fail = [&](std::size_t joint, const std::string& text) {
    const JointDescription& d = m.scene.links[joint].joint;
    throw InputError(d.source.prefix() + "joint '" + d.name + "' " + text);
  };
  for (std::size_t i = 0; i < m.joints.size(); ++i) {
    const CompiledJoint& joint = m.joints[i];
    if (!m.scene.links[i].joint.follows.empty() || is_transmission(m.scene, m.scene.links[i].joint))
      continue;  // those that it follows have a mass
    for (int k = 0; k < joint.link_count; ++k) {
      const auto link = std::size_t(joint.first_link + k);
      if (!(carried[link].mass > 0))
        fail(i,
             "moves nothing that has mass; expected a body with mass on it or on a joint that "
             "it carries");
      if (!turns_inertia(m, m.links[link], carried[link]))
        fail(i,
             "turns points of mass alone, about themselves where joints are at rest; expected a "
             "body with an inertia on it or on a joint that it carries");
    }
  }
}

}  // namespace tangere
