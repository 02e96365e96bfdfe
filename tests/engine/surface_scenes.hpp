// SPDX-License-Identifier: Apache-2.0
// Scenes of two bodies that touch with their surfaces: one is fixed, the other moves up and down.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/scene/frames.hpp"
#include "engine/scene/mass_properties.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/scene/surface_contact.hpp"
#include "engine/scene/surface_points.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere::testing {

inline constexpr double kPi = std::numbers::pi;

/// A turn by an angle about an axis [rad].
inline Quaternion turned(const Vector3& axis, double angle) {
  const Vector3 n = std::sin(angle / 2) * unit(axis);
  return {std::cos(angle / 2), n[0], n[1], n[2]};
}
inline constexpr Quaternion kUpright = {1, 0, 0, 0};
inline const Quaternion kAlongX = turned({0, 1, 0}, kPi / 2), kAlongY = turned({1, 0, 0}, kPi / 2);

inline Shape mesh_of(MeshShape mesh, int resolution = 24) {
  mesh.resolution = resolution;
  return mesh;
}

/// A body that is fixed in the world, and one above it that can only move up and down.
inline Scene above(const Shape& lower, const Quaternion& lower_turn, const Shape& upper,
                   const Quaternion& upper_turn, const Vector3& at, const ContactCoefficients& law,
                   std::optional<double> pitch = {}) {
  Scene s;
  s.timestep = 1e-3;
  s.gravity = {0, 0, -9.81};
  s.ground = GroundDescription{};
  s.links = {link("lower", JointType::fixed, {0, 0, 0}, lower, 1000),
             link("upper", JointType::prismatic, at, upper, 1000)};
  s.links[1].joint.axis0 = {0, 0, 1};
  s.links[0].body.pose.orientation = lower_turn;
  s.links[1].body.pose.orientation = upper_turn;
  const std::vector<std::string> warnings =
      add_surface_contact(s, {"lower", "upper", law, ContactLaw::clamped, pitch, {}});
  EXPECT_TRUE(pitch || warnings.empty()) << warnings.front();
  return s;
}

/// The force with which the contact pushes the upper body up at the start [N].
inline double lift(const Scene& scene) {
  const Model model(scene);
  Stepper stepper(model, options(Integrator::bdf1, 1e-7, 1e-13));
  Batch batch(model, 1);
  stepper.step(batch, {});
  const double mass = mass_properties(scene.links[1].body.shape, scene.links[1].body.density).mass;
  return mass * (v_of(batch)[0] / 1e-7 + 9.81);
}

struct PosedPair {
  const char* name;
  Shape lower;
  Quaternion lower_turn;
  Shape upper;
  Quaternion upper_turn;
  Vector3 beside = {0, 0, 0};
};

inline std::vector<PosedPair> poses() {
  const Shape beam = CuboidShape{{0.2, 0.03, 0.03}}, plank = CuboidShape{{0.2, 0.04, 0.008}},
              box = CuboidShape{{0.06, 0.06, 0.06}}, rod = CylinderShape{0.16, 0.012},
              pill = CapsuleShape{0.12, 0.015}, ball = SphereShape{0.03},
              egg = EllipsoidShape{{0.05, 0.06, 0.1}}, disc = CylinderShape{0.02, 0.05};
  const Shape post = mesh_of(cuboid_mesh({0.03, 0.03, 0.05})),
              cube = mesh_of(cuboid_mesh({0.03, 0.03, 0.03})),
              bar = mesh_of(cuboid_mesh({0.06, 0.02, 0.02}), 48),
              round = mesh_of(ellipsoid_mesh(2, {0.03, 0.03, 0.05}));
  const Quaternion skew = turned({0, 0, 1}, 0.6), tilt = turned({1, 0, 0}, kPi / 4),
                   roll = turned({0, 1, 0}, kPi / 4), corner = turned({1, -1, 0}, 0.955317),
                   lean = turned({1, 0.3, 0}, 0.7);
  const auto times = [](const Quaternion& a, const Quaternion& b) {
    return Quaternion{a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                      a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                      a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                      a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  };
  return {
      {"rod across a beam", beam, kUpright, rod, kAlongY},
      {"rod skew across a beam", beam, kUpright, rod, times(skew, kAlongY), {0.02, 0.004, 0}},
      {"crossed rods", rod, kAlongX, rod, kAlongY},
      {"skew rods", rod, kAlongX, rod, times(skew, kAlongX)},
      {"crossed capsules", pill, kAlongX, pill, kAlongY},
      {"capsule across a rod", rod, kAlongX, pill, kAlongY, {0.03, 0, 0}},
      {"parallel capsules", pill, kAlongX, pill, kAlongX, {0.02, 0, 0}},
      {"crossed planks", plank, kUpright, plank, turned({0, 0, 1}, kPi / 2)},
      {"skew planks", plank, kUpright, plank, skew, {0.03, 0.01, 0}},
      {"planks on edge", plank, kAlongY, plank, times(turned({0, 0, 1}, kPi / 2), kAlongY)},
      {"edge across edge", beam, tilt, beam, times(turned({0, 0, 1}, kPi / 2), tilt)},
      {"edge across edge, skew", beam, tilt, beam, times(skew, tilt)},
      {"edge on a face", box, kUpright, box, roll, {0.004, 0.003, 0}},
      {"corner on a face", box, kUpright, box, corner, {0.003, 0.002, 0}},
      {"corner on a ball", ball, kUpright, box, corner},
      {"corner on a capsule", pill, kAlongX, box, corner},
      {"disc end-on on a beam", beam, kUpright, disc, kUpright, {0, 0.004, 0}},
      {"rim on a face", box, kUpright, disc, lean, {0.002, 0.001, 0}},
      {"rim on a rod", rod, kAlongX, disc, lean},
      {"rod end-on on a rod", rod, kAlongX, rod, kUpright},
      {"rod end-on on a rod's end", rod, kUpright, rod, kUpright, {0.008, 0, 0}},
      {"capsule end-on on a ball", ball, kUpright, pill, kUpright},
      {"ball on a capsule", pill, kAlongX, ball, kUpright, {0.05, 0, 0}},
      {"ellipsoid's tip on a rod", rod, kAlongX, egg, kUpright},
      {"crossed ellipsoids", egg, kAlongX, egg, kAlongY},
      {"ellipsoid on a plane", PlaneShape{}, kUpright, egg, lean},
      {"rim on a plane", PlaneShape{}, kUpright, disc, lean},
      {"mesh on a mesh post", post, kUpright, cube, kUpright, {0.005, 0.003, 0}},
      {"mesh edge on a mesh edge", bar, tilt, bar, times(turned({0, 0, 1}, kPi / 2), tilt)},
      {"mesh corner on a mesh", post, kUpright, cube, corner, {0.002, 0.001, 0}},
      {"mesh corner on a plane", PlaneShape{}, kUpright, cube, corner},
      {"ball on a mesh", cube, kUpright, ball, kUpright, {0.007, 0.003, 0}},
      {"ball on a mesh edge", bar, tilt, ball, kUpright},
      {"rod across a mesh bar", bar, kUpright, rod, kAlongY, {0.02, 0, 0}},
      {"capsule on a round mesh", round, kAlongX, pill, kAlongY},
      {"mesh on an ellipsoid", egg, kAlongX, cube, kUpright},
      {"rod across a plate's edge", CuboidShape{{0.003, 0.1, 0.1}}, kUpright, rod, kAlongX},
      {"rod beside a thin edge",
       CuboidShape{{0.002, 0.1, 0.1}},
       kUpright,
       rod,
       kAlongX,
       {0.005, 0, 0}},
      {"capsule across a plate's edge",
       CuboidShape{{0.005, 0.1, 0.1}},
       kUpright,
       pill,
       kAlongX,
       {0.0013, 0, 0}},
      {"capsule on a blade", CuboidShape{{0.1, 0.003, 0.1}}, kUpright, pill, kAlongX},
      {"ball on a blade", CuboidShape{{0.1, 0.003, 0.1}}, kUpright, ball, kUpright, {0.0013, 0, 0}},
      {"rod across an edge", CuboidShape{{0.06, 0.2, 0.06}}, roll, rod, kAlongX, {0.0013, 0, 0}},
      {"rod across a mesh edge",
       mesh_of(cuboid_mesh({0.03, 0.06, 0.03})),
       roll,
       rod,
       kAlongX,
       {0.0025, 0, 0}},
      {"plank on a mesh's corner", cube, corner, plank, kUpright, {0.001, 0.002, 0}}};
}

/// Whether the bodies overlap when the upper one is at height z. Points of both are tried.
class Overlap {
 public:
  explicit Overlap(const PosedPair& p) : p_(p) {
    for (const bool upper : {false, true}) {
      const Shape& shape = upper ? p.upper : p.lower;
      if (!has_surface(shape)) continue;
      const SurfacePoints points = surface_points(shape, 1e-3, 1e-3);
      for (std::size_t k = 0; k < points.size(); ++k)
        points_[upper ? 1 : 0].push_back(outer_point(
            Pose{{}, upper ? p.upper_turn : p.lower_turn},
            {points.places[3 * k], points.places[3 * k + 1], points.places[3 * k + 2]}));
    }
  }
  [[nodiscard]] bool at(double z) const {
    const Vector3 up = {p_.beside[0], p_.beside[1], z};
    return std::ranges::any_of(
               points_[1],
               [&](const Vector3& x) { return inside(p_.lower, p_.lower_turn, x + up); }) ||
           std::ranges::any_of(points_[0], [&](const Vector3& x) {
             return inside(p_.upper, p_.upper_turn, x - up);
           });
  }

 private:
  static bool inside(const Shape& shape, const Quaternion& turn, const Vector3& x) {
    const Quaternion back = {turn[0], -turn[1], -turn[2], -turn[3]};
    const Vector3 y = outer_point(Pose{{}, back}, x);
    if (const auto* const mesh = std::get_if<MeshShape>(&shape)) {  // a convex one
      for (const std::array<int, 3>& t : mesh->triangles) {
        std::array<Vector3, 3> v;
        for (std::size_t k = 0; k < 3; ++k)
          for (std::size_t c = 0; c < 3; ++c) v[k][c] = mesh->vertices[3 * std::size_t(t[k]) + c];
        if (dot(cross(v[1] - v[0], v[2] - v[0]), y - v[0]) > 0) return false;
      }
      return true;
    }
    return distance_from(shape, y)->distance < 0;
  }

  const PosedPair& p_;
  std::array<std::vector<Vector3>, 2> points_;
};

/// The height at which the upper body touches on its way down [m].
inline double touching_height(const PosedPair& p) {
  const Overlap overlap(p);
  double apart = 0.5, together = 0;
  EXPECT_TRUE(overlap.at(together));
  while (apart - together > 1e-6) {
    const double middle = 0.5 * (apart + together);
    (overlap.at(middle) ? together : apart) = middle;
  }
  return apart;
}

}  // namespace tangere::testing
