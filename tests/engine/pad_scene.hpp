// SPDX-License-Identifier: Apache-2.0
// A pad of any kind on an arm, and a body of any shape that floats in it.
#pragma once

#include "tests/engine/gradient_run.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere::testing {

enum class Pad { flat, skewed, curved };

inline Shape shape_of(PrimitiveShape s) {
  switch (s) {
    case PrimitiveShape::sphere: return SphereShape{0.03};
    case PrimitiveShape::cuboid: return CuboidShape{{0.05, 0.04, 0.03}, {3, 3, 3}};
    case PrimitiveShape::plane: return PlaneShape{};
    case PrimitiveShape::cylinder: return CylinderShape{0.05, 0.02, 8, 2};
    case PrimitiveShape::ellipsoid: return EllipsoidShape{{0.07, 0.05, 0.04}, 12};
    case PrimitiveShape::mesh: {
      MeshShape mesh = ellipsoid_mesh(1, {0.035, 0.025, 0.02});
      mesh.resolution = 12;
      return mesh;
    }
    case PrimitiveShape::capsule: break;
  }
  return CapsuleShape{0.04, 0.02, 3, 4};
}

/// A pad on an arm of two joints, and a body that floats in it (a half-space stands still).
inline Scene pad_scene(PrimitiveShape shape, ContactLaw law, Pad pad) {
  Scene s;
  s.links = {
      link("arm", JointType::revolute, {0, 0, 0}, CuboidShape{{0.02, 0.02, 0.1}, {2, 2, 2}}, 500),
      link("hand", JointType::free, {0.01, 0, 0.05}, CuboidShape{{0.06, 0.06, 0.02}, {2, 2, 2}},
           500),
      link("thing", shape == PrimitiveShape::plane ? JointType::fixed : JointType::free,
           {0.013, -0.025, 0.057}, shape_of(shape), 300)};
  s.links[1].parent = 0;
  s.links[0].joint.axis0 = {0, 1, 0};
  s.links[1].body.pose = {{0.003, -0.004, 0.01}, {0.6, 0.8, 0, 0}};
  TactileDescription t;
  t.name = "skin";
  t.body = "hand";
  t.coefficients = {200, 2, 0.6, 30};
  t.law = law;
  if (pad == Pad::curved) {
    Random random(3);
    for (int i = 0; i < 150; ++i) {
      TactilePoint p;
      const double x = random.uniform(-0.025, 0.025), y = random.uniform(-0.025, 0.025);
      const kernels::Mat3<double> R = random.rotation();
      p.position = {x, y, 0.004 * std::sin(100 * x)};
      p.normal = {R.m[0][2], R.m[1][2], R.m[2][2]}, p.axis0 = {R.m[0][0], R.m[1][0], R.m[2][0]};
      p.axis1 = {R.m[0][1], R.m[1][1], R.m[2][1]};
      p.factors = {random.uniform(0.5, 2), random.uniform(0.5, 2), random.uniform(0.5, 2),
                   random.uniform(0.5, 2)};
      t.points.push_back(p);
    }
    t.pressure_sign = 1;
  } else {
    t.array = {{-0.025, -0.025, 0.01}, {0.025, 0.025, 0.01}, {1, 0, 0}, {0, 1, 0}, 11, 13};
    if (pad == Pad::skewed) t.array.axis0 = {1, 4e-4, 0}, t.array.axis1 = {-3e-4, 1, 0};
  }
  t.feels = {"arm", "thing"};  // the arm is its neighbour
  s.sensors.push_back(t);
  s.end_effectors.push_back({"tip", "hand_joint", {0.01, 0.02, 0.03}, 2e-3, {1, 0, 0, 1}, {}});
  s.end_effectors.push_back({"elbow", "arm_joint", {0.01, 0, 0.05}, 2e-3, {1, 0, 0, 1}, {}});
  return s;
}

struct PadState {
  std::vector<double> q, v;
};

inline PadState random_pad_state(const Model& model, Random& random) {
  Batch batch(model, 1);
  PadState s{q_of(batch), v_of(batch)};
  for (int i = 0; i < model.nv(); ++i) {
    s.q = moved(model, s.q, i, 0.02 * random.normal());
    s.v[std::size_t(i)] = 0.3 * random.normal();
  }
  return s;
}

}  // namespace tangere::testing
