// SPDX-License-Identifier: Apache-2.0
// Scenes for tests, built in code: seeded random trees with every joint kind, touching bodies and
// ground.
#pragma once

#include "engine/scene/scene.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/scene/surface_contact.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere::testing {

inline Vector3 array(const kernels::Vec3<double>& v) { return {v.x, v.y, v.z}; }

inline Pose random_pose(Random& random, double reach) {
  const kernels::Quat<double> q = random.quaternion();
  return {array(random.vector(reach)), {q.w, q.x, q.y, q.z}};
}

inline Shape random_shape(Random& random) {
  switch (random.integer(0, 4)) {
    case 0: return SphereShape{random.uniform(0.02, 0.06)};
    case 1: return CylinderShape{random.uniform(0.04, 0.1), random.uniform(0.02, 0.05), 5, 2};
    case 2: return CapsuleShape{random.uniform(0.02, 0.08), random.uniform(0.02, 0.05), 3, 5};
    case 3:
      return EllipsoidShape{
          {random.uniform(0.04, 0.1), random.uniform(0.04, 0.1), random.uniform(0.04, 0.1)}, 25};
    default: break;
  }
  return CuboidShape{
      {random.uniform(0.04, 0.1), random.uniform(0.04, 0.1), random.uniform(0.04, 0.1)}, {3, 4, 3}};
}

/// A tree of `links` links: random joints, frames, shapes and densities, no contacts.
inline Scene random_tree(unsigned seed, int links) {
  Random random(seed);
  constexpr JointType kTypes[] = {
      JointType::fixed,         JointType::revolute, JointType::prismatic, JointType::planar,
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

/// Gives each link that moves a share of gravity of its own.
inline void share_gravity(Scene& s, unsigned seed) {
  Random random(seed + 8000);
  for (LinkDescription& l : s.links)
    l.body.gravity_share = l.parent < 0 || l.joint.type != JointType::fixed
                               ? random.uniform(-0.5, 1.5)
                               : s.links[std::size_t(l.parent)].body.gravity_share;
}

/// Lets the coefficients of a contact count per area: the body's own points stand for areas around
/// `scale`.
inline void count_by_area(PairContactDescription& contact, const Shape& shape, double scale,
                          Random& random) {
  contact.points = contact_points(shape);
  for (std::size_t k = 0; k < contact.points.size() / 3; ++k)
    contact.areas.push_back(scale * random.uniform(0.5, 2));
}

/// The same, but every body touches every other body that can move relative to
/// it, and the ground is in reach. A half-space is fixed in the world or to the first link. The
/// contacts of the second body, one of them with the ground, count by area.
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
    return ContactCoefficients{
        random.uniform(50, 500), random.uniform(0.1, 2), random.uniform(0.2, 1.2),
        law == ContactLaw::linear ? random.uniform(0, 0.1) : random.uniform(0, 10)};
  };
  // The link with which a body moves; -1: the world. Bodies on fixed joints follow their parents.
  std::vector<int> moves_with;
  for (const LinkDescription& l : s.links)
    moves_with.push_back(l.joint.type != JointType::fixed ? static_cast<int>(moves_with.size())
                         : l.parent < 0                   ? -1
                                                          : moves_with[std::size_t(l.parent)]);
  for (std::size_t a = 0; a < s.links.size(); ++a) {
    const BodyDescription& first = s.links[a].body;
    if (moves_with[a] >= 0)
      s.ground_contacts.push_back({first.name, coefficients(), law, 1e-5, {}});
    if (moves_with[a] != (wall.parent < 0 ? -1 : moves_with[std::size_t(wall.parent)]))
      s.pair_contacts.push_back({first.name, wall.body.name, coefficients(), law, 1e-5, {}});
    for (std::size_t b = 0; b < s.links.size(); ++b)
      if (moves_with[a] != moves_with[b])
        s.pair_contacts.push_back(
            {first.name, s.links[b].body.name, coefficients(), law, 1e-5, {}});
  }
  const std::string by_area = s.links.size() > 1 ? s.links[1].body.name : "";
  Random areas(seed + 2000);
  for (PairContactDescription& c : s.pair_contacts)
    if (c.general_body == by_area && !is_ball(s.links[1].body.shape))
      count_by_area(c, s.links[1].body.shape, 1, areas);
  if (s.links.size() > 1 && moves_with[1] >= 0 && !is_ball(s.links[1].body.shape)) {
    PairContactDescription ground{by_area, kGroundName, coefficients(), law, 1e-5, {}};
    ground.on_ground = true;
    count_by_area(ground, s.links[1].body.shape, 1, areas);
    s.pair_contacts.push_back(ground);
  }
  s.links.push_back(wall);
  return s;
}

}  // namespace tangere::testing
