// SPDX-License-Identifier: Apache-2.0
// Seeded random trees with joint effects, motors, massless bodies, and contacts with bodies that
// are fixed in the world.
#pragma once

#include <algorithm>
#include <cmath>

#include "engine/model/compile.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "tests/engine/random_scene.hpp"

namespace tangere::testing {

/// Damping, armature, a spring and limits, each with probability `share`. The tests' coordinates
/// lie around the limits.
inline JointEffects random_effects(Random& random, double share) {
  const auto maybe = [&](double low, double high) {
    const double x = random.uniform(low, high);
    return random.uniform(0, 1) < share ? x : 0;
  };
  JointEffects e;
  e.damping = maybe(0.01, 0.1);
  e.armature = maybe(0.001, 0.05);
  e.stiffness = maybe(1, 20);
  e.limit_stiffness = maybe(10, 200);
  const double middle = random.uniform(-0.02, 0.02);
  e.limits = {middle - random.uniform(0, 0.05), middle + random.uniform(0, 0.05)};
  return e;
}

/// Takes the mass from some of the bodies that carry something with mass.
inline void drop_masses(Scene& s, Random& random) {
  std::vector<char> carries(s.links.size(), 0);
  for (std::size_t i = s.links.size(); i-- > 0;) {
    BodyDescription& body = s.links[i].body;
    if (carries[i] != 0 && random.uniform(0, 1) < 0.3) body.density = 0;
    if (body.density > 0 && s.links[i].parent >= 0) carries[std::size_t(s.links[i].parent)] = 1;
  }
}

/// A tree in which every effect of a joint occurs, and motors of both kinds and massless bodies as
/// well.
inline Scene random_machine(unsigned seed, int links) {
  Scene s = random_tree(seed, links);
  Random random(seed + 5000);
  for (LinkDescription& l : s.links) {
    static_cast<JointEffects&>(l.joint) = random_effects(random, 0.5);
    const int n = dof_count(l.joint.type);
    if (random.uniform(0, 1) < 0.5)
      for (int k = 0; k < n; ++k) l.joint.rest.push_back(random.uniform(-0.3, 0.3));
    if (l.joint.type == JointType::free || l.joint.type == JointType::free2d) {
      if (random.uniform(0, 1) < 0.5) l.joint.turning = random_effects(random, 0.8);
      continue;
    }
    const int kind = random.integer(0, 3);
    if (n == 0 || kind == 0) continue;
    MotorDescription motor{l.joint.name, -2, 3, {}};
    if (kind > 1) {
      motor.control = MotorControl::position;
      motor.P = random.uniform(1, 10);
      motor.D = random.uniform(0, 0.1);
      motor.low =
          kind == 2 ? -HUGE_VAL : random.uniform(-2, -0.5);  // clipped about as often as not
      motor.high = kind == 2 ? HUGE_VAL : random.uniform(0.5, 2);
    }
    s.motors.push_back(motor);
  }
  drop_masses(s, random);
  return s;
}

/// Gives all motors a scale, an offset and a range that random controls leave, force motors a D,
/// and each joint that is driven a second motor.
inline void map_controls(Scene& s, unsigned seed) {
  Random random(seed + 7000);
  std::vector<MotorDescription> more;
  for (MotorDescription& m : s.motors) {
    m.scale = (random.integer(0, 1) == 0 ? 1 : -1) * random.uniform(0.3, 2);
    m.offset = random.uniform(-0.2, 0.2);
    m.u_range = {-random.uniform(0.2, 0.5), random.uniform(0.2, 0.5)};
    more.push_back({m.joint, -0.5, 0.6, {}});
    more.back().name = m.joint + "_more";
  }
  s.motors.insert(s.motors.end(), more.begin(), more.end());
  Random gains(seed + 7500);
  for (MotorDescription& m : s.motors) {
    const auto of = std::find_if(s.links.begin(), s.links.end(),
                                 [&](const auto& l) { return l.joint.name == m.joint; });
    const double D = gains.uniform(0.05, 0.5);
    if (m.control == MotorControl::force && m.scale && of->joint.type != JointType::spherical)
      m.D = D;
  }
}

/// A tree on a fixed root. Its cuboids touch the root's body, whose points touch them.
inline Scene random_machine_on_a_base(unsigned seed, int links) {
  Scene s = random_machine(seed, links);
  Random random(seed + 9000);
  s.links[0].joint.type = JointType::fixed;
  s.links[0].joint.rest.clear();
  s.links[0].body.shape = CuboidShape{{0.1, 0.08, 0.12}, {4, 3, 3}};
  s.links[1].joint.type = JointType::free;
  s.links[1].joint.rest.clear();
  std::erase_if(s.motors,
                [&](const MotorDescription& m) { return m.joint == s.links[1].joint.name; });
  for (LinkDescription& l : s.links) l.body.density = std::max(l.body.density, 100.0);
  std::vector<bool> stands = {true};  // moves with the world
  for (std::size_t i = 1; i < s.links.size(); ++i) {
    const LinkDescription& l = s.links[i];
    stands.push_back(l.joint.type == JointType::fixed &&
                     (l.parent < 0 || stands[std::size_t(l.parent)]));
    if (stands[i]) continue;
    const ContactCoefficients c = {random.uniform(50, 500), random.uniform(0.1, 2),
                                   random.uniform(0.2, 1.2), 1};
    s.pair_contacts.push_back(
        {s.links[0].body.name, l.body.name, c, ContactLaw::clamped, 1e-5, {}});
    if (std::holds_alternative<CuboidShape>(l.body.shape))
      s.pair_contacts.push_back(
          {l.body.name, s.links[0].body.name, c, ContactLaw::clamped, 1e-5, {}});
  }
  return s;
}

/// Closes loops between bodies that move against each other, or with the world; half are welds.
inline void close_loops(Scene& s, unsigned seed, int count) {
  Random random(seed + 11000);
  const int bodies = static_cast<int>(s.links.size());
  for (int tries = 0; tries < 20 && static_cast<int>(s.loops.size()) < count; ++tries) {
    const int one = random.integer(0, bodies - 1), two = random.integer(-1, bodies - 1);
    if (moving_link(s, one) == (two < 0 ? -1 : moving_link(s, two))) continue;
    const auto place = [&] {
      return Vector3{random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05),
                     random.uniform(-0.05, 0.05)};
    };
    LoopDescription d;
    d.name = "loop" + std::to_string(s.loops.size());
    d.body1 = s.links[std::size_t(one)].body.name;
    if (two >= 0) d.body2 = s.links[std::size_t(two)].body.name;
    d.position1 = place();
    d.position2 = place();  // without it, the point follows places of joints
    d.stiffness = random.uniform(50, 500);
    d.damping = random.uniform(0.1, 1);
    d.weld = s.loops.size() % 2 == 1;
    if (d.weld) {
      const kernels::Quat<double> q = random.quaternion();
      d.orientation2 = Quaternion{q.w, q.x, q.y, q.z};
      d.turning_stiffness = random.uniform(0.5, 5);
      d.turning_damping = random.uniform(0.01, 0.1);
    }
    s.loops.push_back(d);
  }
}

/// Adds a joint without mass, with effects and a motor, for a transmission.
inline std::string add_transmission_joint(Scene& s, Random& random, const std::string& name,
                                          double rest) {
  LinkDescription l;
  l.name = l.body.name = name;
  l.joint.name = name;
  l.joint.type = JointType::prismatic;
  l.joint.axis0 = {1, 0, 0};
  l.body.shape = AbstractShape{};
  static_cast<JointEffects&>(l.joint) = random_effects(random, 0.7);
  for (double& limit : *l.joint.limits) limit += rest;
  l.joint.rest = {rest};
  s.links.push_back(l);
  MotorDescription motor{name, -2, 3, {}};
  motor.control = MotorControl::position;
  motor.P = random.uniform(1, 10);
  motor.D = random.uniform(0, 0.1);
  motor.offset = rest;
  motor.low = -random.uniform(0.5, 2), motor.high = random.uniform(0.5, 2);
  s.motors.push_back(motor);
  return name;
}

/// Adds paths between bodies, every second one around a surface, and wrenches on bodies.
inline void add_transmissions(Scene& s, unsigned seed, int count) {
  Random random(seed + 13000);
  const int bodies = static_cast<int>(s.links.size());
  const auto place = [&](double size) {
    return Vector3{random.uniform(-size, size), random.uniform(-size, size),
                   random.uniform(-size, size)};
  };
  const auto body = [&] {
    const int k = random.integer(-1, bodies - 1);
    return k < 0 ? std::string() : s.links[std::size_t(k)].body.name;
  };
  for (int t = 0; t < count; ++t) {
    TransmissionDescription d;
    const std::string moved = s.links[std::size_t(random.integer(0, bodies - 1))].body.name;
    if (t % 3 == 2) {
      d.kind = TransmissionDescription::Kind::wrench;
      d.body = moved;
      d.position = place(0.1);
      d.force = place(1), d.torque = place(0.2);
      if (random.integer(0, 1) == 0) d.reference = body(), d.torque = {};
      if (d.reference == d.body) d.reference.reset();
    } else {
      d.path = {{.body = body(), .position = place(0.3)}};
      const bool around = random.integer(0, 3) != 0;
      const bool ball = random.integer(0, 1) == 0;
      if (around) {
        PathPart part;
        part.kind = ball ? PathPart::Kind::sphere : PathPart::Kind::cylinder;
        part.body = body();
        part.position = place(0.1);
        part.radius = random.uniform(0.02, 0.06);
        part.axis = place(1);
        if (random.integer(0, 1) == 0) {
          part.side = part.position;
          for (double& x : *part.side) x += random.uniform(0.2, 0.4);
        }
        d.path.push_back(part);
      }
      d.path.push_back({.body = moved, .position = place(0.3)});
      if (random.integer(0, 1) == 0) {
        d.path.push_back({.kind = PathPart::Kind::pulley, .divisor = 2});
        d.path.push_back({.body = body(), .position = place(0.3)});
        d.path.push_back({.body = moved, .position = place(0.3)});
      }
    }
    const double rest = d.kind == TransmissionDescription::Kind::path ? 0.5 : 0;
    d.joint = add_transmission_joint(s, random, "cord" + std::to_string(t), rest);
    s.transmissions.push_back(d);
    try {
      const auto compiled = compile(s);
    } catch (const InputError&) {  // a side inside of a surface, or bodies that stand
      s.transmissions.pop_back();
      s.links.pop_back();
      s.motors.pop_back();
    }
  }
}

}  // namespace tangere::testing
