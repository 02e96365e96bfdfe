// SPDX-License-Identifier: Apache-2.0
// Scenes for tests, built in code: seeded random trees with every joint kind, touching bodies, ground.
#pragma once

#include <cmath>

#include "engine/scene.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere::testing {

inline Vector3 array(const kernels::Vec3<double>& v) { return {v.x, v.y, v.z}; }

inline Pose random_pose(Random& random, double reach) {
  const kernels::Quat<double> q = random.quaternion();
  return {array(random.vector(reach)), {q.w, q.x, q.y, q.z}};
}

inline Shape random_shape(Random& random) {
  switch (random.integer(0, 3)) {
    case 0: return SphereShape{random.uniform(0.02, 0.06)};
    case 1: return CylinderShape{random.uniform(0.04, 0.1), random.uniform(0.02, 0.05), 5, 2};
    case 2: return CapsuleShape{random.uniform(0.02, 0.08), random.uniform(0.02, 0.05), 3, 5};
    default: break;
  }
  return CuboidShape{{random.uniform(0.04, 0.1), random.uniform(0.04, 0.1), random.uniform(0.04, 0.1)}, {3, 4, 3}};
}

/// A tree of `links` links: random joints, frames, shapes and densities, no contacts.
inline Scene random_tree(unsigned seed, int links) {
  Random random(seed);
  constexpr JointType kTypes[] = {JointType::fixed,         JointType::revolute, JointType::prismatic, JointType::planar,
                                  JointType::translational, JointType::free2d,   JointType::spherical, JointType::free};
  Scene s;
  s.name = "tree";
  s.gravity = array(random.vector(6));
  s.timestep = 0.004;
  for (int i = 0; i < links; ++i) {
    LinkDescription l;
    l.name = "link" + std::to_string(i);
    l.parent = i == 0 ? -1 : random.integer(-1, i - 1);
    l.joint.name = "joint" + std::to_string(i);
    l.joint.type = kTypes[i == 0 ? 7 : random.integer(0, 7)];
    l.joint.pose = random_pose(random, 0.1);
    l.joint.axis0 = array(random.direction());
    l.joint.axis1 = array(random.direction());
    l.joint.damping = random.uniform(0, 0.1);
    l.body.name = "body" + std::to_string(i);
    l.body.pose = random_pose(random, 0.05);
    l.body.density = random.uniform(100, 2000);
    l.body.shape = random_shape(random);
    s.links.push_back(l);
  }
  return s;
}

/// Damping, armature, a spring and limits, each with probability `share`; coordinates of tests lie around the limits.
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

/// The bodies that have something with mass on them lose theirs, some of them.
inline void drop_masses(Scene& s, Random& random) {
  std::vector<char> carries(s.links.size(), 0);
  for (std::size_t i = s.links.size(); i-- > 0;) {
    BodyDescription& body = s.links[i].body;
    if (carries[i] != 0 && random.uniform(0, 1) < 0.3) body.density = 0;
    if (body.density > 0 && s.links[i].parent >= 0) carries[std::size_t(s.links[i].parent)] = 1;
  }
}

/// A tree in which every effect of a joint occurs, motors of both kinds and massless bodies too.
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
      motor.low = kind == 2 ? -HUGE_VAL : random.uniform(-2, -0.5);  // clipped about as often as not
      motor.high = kind == 2 ? HUGE_VAL : random.uniform(0.5, 2);
    }
    s.motors.push_back(motor);
  }
  drop_masses(s, random);
  return s;
}

/// The same with every body that has contact points touching every other it can move against, and the ground in reach. A
/// half-space is fixed in the world, or to the first link.
inline Scene random_contacts(unsigned seed, int links, ContactLaw law) {
  Scene s = random_tree(seed, links);
  Random random(seed + 1000);
  LinkDescription wall;
  wall.name = wall.joint.name = wall.body.name = "wall";
  wall.parent = seed % 2 == 0 ? -1 : 0;
  wall.joint.pose = random_pose(random, 0.05);
  wall.body.shape = PlaneShape{};
  s.ground = GroundDescription{array(random.vector(0.02)), array(random.direction())};
  const auto coefficients = [&] {
    return ContactCoefficients{random.uniform(50, 500), random.uniform(0.1, 2), random.uniform(0.2, 1.2),
                               law == ContactLaw::linear ? random.uniform(0, 0.1) : random.uniform(0, 10)};
  };
  // The link that a body moves with, -1 the world: bodies on fixed joints follow what they hang on.
  std::vector<int> moves_with;
  for (const LinkDescription& l : s.links)
    moves_with.push_back(l.joint.type != JointType::fixed ? static_cast<int>(moves_with.size())
                         : l.parent < 0                   ? -1
                                                          : moves_with[std::size_t(l.parent)]);
  for (std::size_t a = 0; a < s.links.size(); ++a) {
    const BodyDescription& first = s.links[a].body;
    if (moves_with[a] >= 0) s.ground_contacts.push_back({first.name, coefficients(), law, 1e-5, {}});
    if (std::holds_alternative<SphereShape>(first.shape)) continue;
    if (moves_with[a] != (wall.parent < 0 ? -1 : moves_with[std::size_t(wall.parent)]))
      s.pair_contacts.push_back({first.name, wall.body.name, coefficients(), law, 1e-5, {}});
    for (std::size_t b = 0; b < s.links.size(); ++b)
      if (moves_with[a] != moves_with[b])
        s.pair_contacts.push_back({first.name, s.links[b].body.name, coefficients(), law, 1e-5, {}});
  }
  s.links.push_back(wall);
  return s;
}

}  // namespace tangere::testing
