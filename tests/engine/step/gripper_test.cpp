// SPDX-License-Identifier: Apache-2.0
// Two plates close on meshes in drawn poses. What they hold or let go is decided by 2 μ F and the
// weight.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "engine/scene/mass_properties.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/scene/surface_contact.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using testing::Random;

/// A prism along z over a polygon that is star-shaped about the origin, anticlockwise.
MeshShape prism_mesh(const std::vector<std::array<double, 2>>& polygon, double half) {
  MeshShape mesh;
  const int n = static_cast<int>(polygon.size());
  for (const double z : {-half, half})
    for (const auto& [x, y] : polygon) mesh.vertices.insert(mesh.vertices.end(), {x, y, z});
  mesh.vertices.insert(mesh.vertices.end(), {0, 0, -half, 0, 0, half});
  for (int j = 0; j < n; ++j) {
    const int next = (j + 1) % n;
    mesh.triangles.push_back({2 * n, next, j});
    mesh.triangles.push_back({2 * n + 1, n + j, n + next});
    mesh.triangles.push_back({j, next, n + next});
    mesh.triangles.push_back({j, n + next, n + j});
  }
  return mesh;
}

struct Object {
  const char* name;
  MeshShape mesh;
};
std::vector<Object> objects() {
  return {{"box of 8 corners", testing::cuboid_mesh({0.02, 0.03, 0.015})},
          {"cube", testing::cuboid_mesh({0.02, 0.02, 0.02})},
          {"plate", testing::cuboid_mesh({0.03, 0.03, 0.006})},
          {"wedge", prism_mesh({{-0.02, -0.015}, {0.03, -0.015}, {-0.02, 0.02}}, 0.02)},
          {"hexagonal bar", prism_mesh({{0.02, 0},
                                        {0.01, 0.0173},
                                        {-0.01, 0.0173},
                                        {-0.02, 0},
                                        {-0.01, -0.0173},
                                        {0.01, -0.0173}},
                                       0.03)},
          {"bolt", testing::turned_mesh(
                       {{-0.03, 0.008}, {0.01, 0.008}, {0.0101, 0.016}, {0.022, 0.016}}, 16)},
          {"bottle", testing::turned_mesh(
                         {{-0.04, 0.018}, {0.01, 0.018}, {0.022, 0.008}, {0.04, 0.008}}, 24)},
          {"egg", testing::ellipsoid_mesh(2, {0.018, 0.022, 0.03})},
          {"ring", testing::torus_mesh(0.022, 0.008, 24, 12)},
          {"capsule", testing::capsule_mesh(0.012, 0.02, 16)}};
}

/// Plates of 0.1 kg that move along y, and an object between them.
Scene gripper(const MeshShape& object, double force) {
  Scene s;
  s.timestep = 1e-3;
  s.gravity = {0, 0, -9.81};
  s.integrator = Integrator::bdf2;
  MeshShape mesh = object;
  mesh.resolution = 32;
  s.links = {testing::link("object", JointType::free, {0, 0, 0}, mesh, 600),
             testing::link("left", JointType::prismatic, {0, -0.01, 0},
                           CuboidShape{{0.16, 0.02, 0.3}}, 100),
             testing::link("right", JointType::prismatic, {0, 0.01, 0},
                           CuboidShape{{0.16, 0.02, 0.3}}, 100)};
  for (const char* const plate : {"left", "right"}) {
    const std::size_t k = plate[0] == 'l' ? 1 : 2;
    s.links[k].joint.axis0 = {0, k == 1 ? 1.0 : -1.0, 0};
    s.motors.push_back({std::string(plate) + "_joint", -force, force, {}});
    EXPECT_TRUE(add_surface_contact(
                    s, {plate, "object", {3e8, 1e6, 0.5, 1e9, 2e8}, ContactLaw::clamped, {}, {}})
                    .empty());
  }
  return s;
}

/// Half the width of a mesh along ±y in an orientation [m].
std::array<double, 2> reach_along_y(const MeshShape& mesh, const Quaternion& turn) {
  std::array<double, 2> reach{};
  for (std::size_t k = 0; k < mesh.vertices.size(); k += 3) {
    const Vector3 at = outer_direction(
        Pose{{}, turn}, {mesh.vertices[k], mesh.vertices[k + 1], mesh.vertices[k + 2]});
    reach[0] = std::max(reach[0], -at[1]);
    reach[1] = std::max(reach[1], at[1]);
  }
  return reach;
}

/// How far an object has fallen, how fast it falls [m, m/s], and the gap between the plates [m].
struct GripOutcome {
  double way, speed, gap;
};
std::vector<GripOutcome> close_on(const MeshShape& mesh, double force, int steps, int poses) {
  const Scene scene = gripper(mesh, force);
  const Model model(scene);
  Stepper stepper(model);
  Batch batch(model, poses);
  Random random(7);
  for (int e = 0; e < poses; ++e) {
    const kernels::Quat<double> q = random.quaternion();
    const auto [left, right] = reach_along_y(mesh, {q.w, q.x, q.y, q.z});
    // A plate's coordinate is how far it has closed from where both would touch at y = 0.
    batch.set_state(e,
                    std::vector<double>{0, 0, 0, q.w, q.x, q.y, q.z, -left - 2e-4, -right - 2e-4},
                    std::vector<double>(8, 0.0));
  }
  std::vector<double> u;
  for (int e = 0; e < poses; ++e) u.insert(u.end(), {1.0, 1.0});
  std::vector<GripOutcome> falls(std::size_t(poses), GripOutcome{});
  for (int k = 0; k < steps; ++k) {
    stepper.step(batch, u);
    for (int e = 0; e < poses; ++e) EXPECT_NE(batch.status(e), StepStatus::tunnelled);
  }
  for (int e = 0; e < poses; ++e) {
    EXPECT_FALSE(failed(batch.status(e)));
    const std::vector<double> q = testing::q_of(batch, e), v = testing::v_of(batch, e);
    falls[std::size_t(e)] = {-q[2], -v[2], -q[7] - q[8]};
  }
  return falls;
}

TEST(Gripper, HoldsOrLetsGoAsTheClosedFormSays) {
  constexpr int kPoses = 8;
  for (const Object& object : objects()) {
    SCOPED_TRACE(object.name);
    const double mass = mass_properties(Shape{object.mesh}, 600).mass, weight = mass * 9.81;
    const double enough = weight / (2 * 0.5);
    int lost = 0, kept = 0, through = 0;
    for (const GripOutcome& f : close_on(object.mesh, 4 * enough, 1000, kPoses)) {
      // It may turn until it lies flat between the plates.
      if (f.way > 0.15 || std::abs(f.speed) > 5e-3) ++lost;
      if (f.gap < 0.008) ++through;
    }
    for (const GripOutcome& f : close_on(object.mesh, 0.25 * enough, 500, kPoses)) {
      // It falls with 3/4 of the acceleration of free fall: 0.92 m in half a second.
      if (f.way < 0.5) ++kept;
      if (f.gap < 0.008 && f.way < 0.1) ++through;
    }
    EXPECT_EQ(lost, 0);
    EXPECT_EQ(kept, 0);
    EXPECT_EQ(through, 0);
  }
}

}  // namespace
}  // namespace tangere
