// SPDX-License-Identifier: Apache-2.0
// Scenes for tests, built in code: seeded random trees with every joint kind, touching bodies, ground.
#pragma once

#include "engine/scene.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere::testing {

inline Vector3 array(const kernels::Vec3<double>& v) { return {v.x, v.y, v.z}; }

inline Pose random_pose(Random& random, double reach) {
  const kernels::Quat<double> q = random.quaternion();
  return {array(random.vector(reach)), {q.w, q.x, q.y, q.z}};
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
    if (random.uniform(0, 1) < 0.4) {
      l.body.shape = SphereShape{random.uniform(0.02, 0.06)};
    } else {
      l.body.shape = CuboidShape{{random.uniform(0.04, 0.1), random.uniform(0.04, 0.1), random.uniform(0.04, 0.1)}, {3, 4, 3}};
    }
    s.links.push_back(l);
  }
  return s;
}

/// The same with every cuboid touching every other body it can move against, and the ground in reach.
inline Scene random_contacts(unsigned seed, int links, ContactLaw law) {
  Scene s = random_tree(seed, links);
  Random random(seed + 1000);
  s.ground = GroundDescription{array(random.vector(0.02)), array(random.direction())};
  const auto coefficients = [&] {
    return ContactCoefficients{random.uniform(50, 500), random.uniform(0.1, 2), random.uniform(0.2, 1.2),
                               law == ContactLaw::linear ? random.uniform(0, 0.1) : random.uniform(0, 10)};
  };
  for (const LinkDescription& a : s.links) {
    if (a.joint.type == JointType::fixed) continue;  // may not move against what it hangs on
    s.ground_contacts.push_back({a.body.name, coefficients(), law, 1e-5, {}});
    if (!std::holds_alternative<CuboidShape>(a.body.shape)) continue;
    for (const LinkDescription& b : s.links)
      if (b.name != a.name && b.joint.type != JointType::fixed)
        s.pair_contacts.push_back({a.body.name, b.body.name, coefficients(), law, 1e-5, {}});
  }
  return s;
}

}  // namespace tangere::testing
