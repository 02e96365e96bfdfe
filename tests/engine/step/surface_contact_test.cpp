// SPDX-License-Identifier: Apache-2.0
// Contacts of whole surfaces: closed forms, convergence, and bodies of all shapes that are pressed
// onto each other in crossed, skew, edge, rim and end-on poses.
#include <gmock/gmock.h>
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

namespace tangere {
namespace {

using testing::q_of;
using testing::v_of;

constexpr double kPi = std::numbers::pi;

/// A turn by an angle about an axis [rad].
Quaternion turned(const Vector3& axis, double angle) {
  const Vector3 n = std::sin(angle / 2) * unit(axis);
  return {std::cos(angle / 2), n[0], n[1], n[2]};
}
constexpr Quaternion kUpright = {1, 0, 0, 0};
const Quaternion kAlongX = turned({0, 1, 0}, kPi / 2), kAlongY = turned({1, 0, 0}, kPi / 2);

Shape mesh_of(MeshShape mesh, int resolution = 24) {
  mesh.resolution = resolution;
  return mesh;
}

/// A body that is fixed in the world, and one above it that can only move up and down.
Scene above(const Shape& lower, const Quaternion& lower_turn, const Shape& upper,
            const Quaternion& upper_turn, const Vector3& at, const ContactCoefficients& law,
            std::optional<double> pitch = {}) {
  Scene s;
  s.timestep = 1e-3;
  s.gravity = {0, 0, -9.81};
  s.ground = GroundDescription{};
  s.links = {testing::link("lower", JointType::fixed, {0, 0, 0}, lower, 1000),
             testing::link("upper", JointType::prismatic, at, upper, 1000)};
  s.links[1].joint.axis0 = {0, 0, 1};
  s.links[0].body.pose.orientation = lower_turn;
  s.links[1].body.pose.orientation = upper_turn;
  EXPECT_EQ(add_surface_contact(s, {"lower", "upper", law, ContactLaw::clamped, pitch, {}}), "");
  return s;
}

/// The force with which the contact pushes the upper body up at the start [N].
double lift(const Scene& scene) {
  const Model model(scene);
  Stepper stepper(model, testing::options(Integrator::bdf1, 1e-7, 1e-13));
  Batch batch(model, 1);
  stepper.step(batch, {});
  const double mass = mass_properties(scene.links[1].body.shape, scene.links[1].body.density).mass;
  return mass * (v_of(batch)[0] / 1e-7 + 9.81);
}

TEST(SurfacePoints, CoverTheAreaAndLieOnTheSurface) {
  struct Case {
    Shape shape;
    double area;
  };
  const double r = 0.03, l = 0.11;
  const std::vector<Case> cases = {
      {SphereShape{r}, 4 * kPi * r * r},
      {CuboidShape{{0.02, 0.05, 0.11}}, 2 * (0.02 * 0.05 + 0.05 * 0.11 + 0.02 * 0.11)},
      {CylinderShape{l, r}, 2 * kPi * r * (l + r)},
      {CapsuleShape{l, r}, 2 * kPi * r * l + 4 * kPi * r * r},
      {EllipsoidShape{{2 * r, 2 * r, 2 * r}}, 4 * kPi * r * r},
      {mesh_of(testing::cuboid_mesh({0.01, 0.025, 0.055})),
       2 * (0.02 * 0.05 + 0.05 * 0.11 + 0.02 * 0.11)}};
  for (const Case& c : cases)
    for (const double pitch : {0.02, 0.01, 0.004}) {
      SCOPED_TRACE(std::string(shape_name(c.shape)) + " " + std::to_string(pitch));
      const SurfacePoints points = surface_points(c.shape, pitch, 2 * pitch);
      double sum = 0;
      Vector3 moment{};
      for (std::size_t k = 0; k < points.size(); ++k) {
        const Vector3 at = {points.places[3 * k], points.places[3 * k + 1],
                            points.places[3 * k + 2]};
        EXPECT_GT(points.areas[k], 0);
        sum += points.areas[k];
        moment = moment + points.areas[k] * at;
        const auto distance = distance_from(c.shape, at);
        EXPECT_NEAR(distance ? distance->distance : 0, 0, 1e-12);
      }
      EXPECT_NEAR(sum, c.area, 1e-9 * c.area);
      // All of these shapes have their middle at the origin.
      const bool rings = !std::holds_alternative<CuboidShape>(c.shape);
      for (const double x : moment) EXPECT_NEAR(x / c.area, 0, (rings ? 0.05 : 1e-9) * pitch);
    }
}

TEST(SurfacePoints, OfAnEllipsoidHaveItsArea) {
  // A spheroid: 2π a² (1 + c/(a e) asin e), e² = 1 - a²/c².
  const double a = 0.02, c = 0.05, e = std::sqrt(1 - a * a / (c * c)),
               area = 2 * kPi * a * a * (1 + c / (a * e) * std::asin(e));
  const Shape shape = EllipsoidShape{{2 * a, 2 * a, 2 * c}};
  EXPECT_NEAR(surface_area(shape), area, 0.01 * area);
  double sum = 0;
  for (const double part : surface_points(shape, 0.002, 0.002).areas) sum += part;
  EXPECT_NEAR(sum, area, 1e-4 * area);
}

TEST(SurfaceContact, OfFlatFacesIsExactAtAnyPitch) {
  const double K = 1e8, depth = 2e-4, side = 0.04;
  const Shape box = CuboidShape{{side, side, side}};
  for (const double pitch : {0.02, 0.011, 0.003}) {
    for (const Shape& below : {Shape{CuboidShape{{0.1, 0.1, 0.02}}}, Shape{PlaneShape{}}}) {
      const bool plane = std::holds_alternative<PlaneShape>(below);
      const double top = plane ? 0 : 0.01;
      const double force =
          lift(above(below, kUpright, box, kUpright, {0.003, -0.002, top + side / 2 - depth},
                     {K, 0, 0, 0}, pitch));
      // Half of the force acts at points of the lower face: those under the box.
      const double error = plane ? 1e-6 : 2 * pitch / side;
      EXPECT_NEAR(force, K * side * side * depth, error * K * side * side * depth) << pitch;
    }
  }
}

TEST(SurfaceContact, ConvergesToTheFoundationUnderRoundBodies) {
  const double K = 1e8, r = 0.03, depth = 1e-3, l = 0.06;
  struct Case {
    Shape shape;
    Quaternion turn;
    double force;
  };
  // The integral of the depth over a cap, along a line, ∫ (δ - r + r cos φ) r dφ, and over the
  // segments of the ends that are below the plane.
  const double edge = std::acos(1 - depth / r);
  double line = 2 * l * r * ((depth - r) * edge + r * std::sin(edge));
  constexpr int kStrips = 10000;
  for (int k = 0; k < kStrips; ++k) {
    const double below = depth * (k + 0.5) / kStrips, height = r - depth + below;
    line += 2 * below * 2 * std::sqrt(r * r - height * height) * depth / kStrips;
  }
  const std::vector<Case> cases = {
      {SphereShape{r}, kUpright, K * kPi * r * depth * depth},
      {EllipsoidShape{{2 * r, 2 * r, 2 * r}}, kUpright, K * kPi * r * depth * depth},
      {CylinderShape{l, r}, kAlongX, K * line}};
  for (const Case& c : cases) {
    SCOPED_TRACE(shape_name(c.shape));
    for (const auto& [pitch, tolerance] :
         {std::pair{2e-3, 0.05}, std::pair{1e-3, 0.02}, std::pair{2.5e-4, 0.003}}) {
      const double force = lift(
          above(PlaneShape{}, kUpright, c.shape, c.turn, {0, 0, r - depth}, {K, 0, 0, 0}, pitch));
      EXPECT_NEAR(force, c.force, tolerance * c.force) << pitch;
    }
  }
}

// --- poses ---

struct Pose2 {
  const char* name;
  Shape lower;
  Quaternion lower_turn;
  Shape upper;
  Quaternion upper_turn;
  Vector3 beside = {0, 0, 0};
};

std::vector<Pose2> poses() {
  const Shape beam = CuboidShape{{0.2, 0.03, 0.03}}, plank = CuboidShape{{0.2, 0.04, 0.008}},
              box = CuboidShape{{0.06, 0.06, 0.06}}, rod = CylinderShape{0.16, 0.012},
              pill = CapsuleShape{0.12, 0.015}, ball = SphereShape{0.03},
              egg = EllipsoidShape{{0.05, 0.06, 0.1}}, disc = CylinderShape{0.02, 0.05};
  const Shape post = mesh_of(testing::cuboid_mesh({0.03, 0.03, 0.05})),
              cube = mesh_of(testing::cuboid_mesh({0.03, 0.03, 0.03})),
              bar = mesh_of(testing::cuboid_mesh({0.06, 0.02, 0.02}), 48),
              round = mesh_of(testing::ellipsoid_mesh(2, {0.03, 0.03, 0.05}));
  const Quaternion skew = turned({0, 0, 1}, 0.6), tilt = turned({1, 0, 0}, kPi / 4),
                   roll = turned({0, 1, 0}, kPi / 4), corner = turned({1, -1, 0}, 0.955317),
                   lean = turned({1, 0.3, 0}, 0.7);
  const auto times = [](const Quaternion& a, const Quaternion& b) {
    return Quaternion{a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
                      a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
                      a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
                      a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
  };
  return {{"rod across a beam", beam, kUpright, rod, kAlongY},
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
          {"plank on a mesh's corner", cube, corner, plank, kUpright, {0.001, 0.002, 0}}};
}

/// Whether the bodies overlap when the upper one is at height z. Points of both are tried.
class Overlap {
 public:
  explicit Overlap(const Pose2& p) : p_(p) {
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

  const Pose2& p_;
  std::array<std::vector<Vector3>, 2> points_;
};

/// The height at which the upper body touches on its way down [m].
double touching_height(const Pose2& p) {
  const Overlap overlap(p);
  double apart = 0.5, together = 0;
  EXPECT_TRUE(overlap.at(together));
  while (apart - together > 1e-6) {
    const double middle = 0.5 * (apart + together);
    (overlap.at(middle) ? together : apart) = middle;
  }
  return apart;
}

TEST(SurfaceContact, HoldsBodiesOfAllShapesInAllPoses) {
  for (const Pose2& p : poses()) {
    SCOPED_TRACE(p.name);
    const double touch = touching_height(p);
    Scene scene = above(p.lower, p.lower_turn, p.upper, p.upper_turn,
                        {p.beside[0], p.beside[1], touch + 0.005}, {1e9, 1e6, 0.5, 3e9});
    const Model model(scene);
    Stepper stepper(model, testing::options(Integrator::bdf2, 1e-3, 1e-9));
    Batch batch(model, 1);
    double lowest = 1;
    for (int k = 0; k < 800; ++k) {
      stepper.step(batch, {});
      lowest = std::min(lowest, q_of(batch)[0]);
      ASSERT_FALSE(failed(batch.status(0)));
      ASSERT_NE(batch.status(0), StepStatus::tunnelled);
    }
    const double sunk = -q_of(batch)[0] - 0.005;
    RecordProperty(p.name, std::to_string(sunk));
    const bool mesh =
        std::holds_alternative<MeshShape>(p.lower) || std::holds_alternative<MeshShape>(p.upper);
    EXPECT_GT(sunk, mesh ? -3e-4 : -1e-5) << "it rests on the other body, not above it";
    EXPECT_LT(sunk, 0.003);
    EXPECT_LT(-lowest - 0.005, 0.005) << "while it lands";
    EXPECT_LT(std::abs(v_of(batch)[0]), 1e-3);
  }
}

/// How deep an edge of one beam lies in that of another that crosses it [m].
TEST(SurfaceContact, ConvergesWhereEdgesAndRodsCross) {
  const std::vector<Pose2> all = poses();
  for (const char* const name : {"edge across edge", "crossed rods", "corner on a face"}) {
    SCOPED_TRACE(name);
    const Pose2& p =
        *std::ranges::find_if(all, [&](const Pose2& x) { return std::string(x.name) == name; });
    const double depth = 0.002, touch = touching_height(p);
    std::vector<double> force;
    for (const double pitch : {2e-3, 1e-3, 5e-4})
      force.push_back(
          lift(above(p.lower, p.lower_turn, p.upper, p.upper_turn,
                     {p.beside[0], p.beside[1], touch - depth}, {1e9, 0, 0, 0}, pitch)));
    EXPECT_GT(force[2], 0);
    EXPECT_LT(std::abs(force[1] - force[2]), 0.1 * force[2]);
    EXPECT_LT(std::abs(force[0] - force[2]), 0.3 * force[2]);
  }
}

// --- motion ---

constexpr double kSlope = 10 * kPi / 180;

/// A body on the ground, which slopes down along x.
Scene on_slope(const Shape& shape, const Quaternion& turn, double height, double stiffness) {
  Scene s;
  s.timestep = 1e-3;
  s.gravity = {9.81 * std::sin(kSlope), 0, -9.81 * std::cos(kSlope)};
  s.ground = GroundDescription{};
  s.links = {testing::link("roll", JointType::free, {0, 0, height}, shape, 500)};
  s.links[0].body.pose.orientation = turn;
  EXPECT_EQ(add_surface_contact(s, {"roll",
                                    "ground",
                                    {stiffness, stiffness / 100, 0.8, stiffness / 10},
                                    ContactLaw::clamped,
                                    {},
                                    {}}),
            "");
  return s;
}

TEST(SurfaceContact, RoundBodiesRollAsTheClosedFormSays) {
  const double r = 0.03, l = 0.1;
  struct Case {
    Shape shape;
    Quaternion turn;
  };
  const std::vector<Case> cases = {{SphereShape{r}, kUpright},
                                   {CylinderShape{l, r}, kAlongY},
                                   {CapsuleShape{l, r}, kAlongY},
                                   {EllipsoidShape{{2 * r, 4 * r, 2 * r}}, kUpright}};
  for (const Case& c : cases)
    for (const double stiffness : {1e8, 1e10}) {
      SCOPED_TRACE(std::string(shape_name(c.shape)) + " " + std::to_string(stiffness));
      const Scene scene = on_slope(c.shape, c.turn, r, stiffness);
      const Model model(scene);
      Stepper stepper(model, testing::options(Integrator::bdf2, 1e-3, 1e-9));
      Batch batch(model, 1);
      for (int k = 0; k < 1000; ++k) stepper.step(batch, {});
      ASSERT_FALSE(failed(batch.status(0)));
      const MassProperties mass = mass_properties(c.shape, 500);
      // The axis about which it rolls: that of the rod, and y.
      const bool rod = !std::holds_alternative<SphereShape>(c.shape) &&
                       !std::holds_alternative<EllipsoidShape>(c.shape);
      const double turning = rod ? mass.inertia.m[2][2] : mass.inertia.m[1][1];
      const double way = 9.81 * std::sin(kSlope) / (1 + turning / (mass.mass * r * r)) / 2;
      EXPECT_NEAR(q_of(batch)[0], way, 0.01 * way);
      EXPECT_NEAR(q_of(batch)[2], 0, 0.01 * r) << "how far it sinks in";
    }
}

TEST(SurfaceContact, StacksOfEqualBoxesStand) {
  const double side = 0.1;
  for (const double shift : {0.0, 1e-6, 1e-4, 1e-2}) {
    SCOPED_TRACE(shift);
    Scene s;
    s.timestep = 2e-3;
    s.gravity = {0, 0, -9.81};
    s.ground = GroundDescription{};
    std::string below = "ground";
    for (int k = 0; k < 5; ++k) {
      const std::string name = "box" + std::to_string(k);
      s.links.push_back(testing::link(name, JointType::free,
                                      {k % 2 == 0 ? 0 : shift, 0, side * (k + 0.5)},
                                      CuboidShape{{side, side, side}}, 500));
      add_surface_contact(s, {name, below, {1e8, 1e6, 0.8, 1e8}, ContactLaw::clamped, {}, {}});
      below = name;
    }
    const Model model(s);
    Stepper stepper(model, testing::options(Integrator::bdf2, 2e-3, 1e-9));
    Batch batch(model, 1);
    for (int k = 0; k < 1000; ++k) stepper.step(batch, {});
    ASSERT_FALSE(failed(batch.status(0)));
    const std::vector<double> q = q_of(batch);
    for (std::size_t k = 0; k < 5; ++k) {
      EXPECT_NEAR(q[7 * k], 0, 1e-3) << "box " << k;
      EXPECT_NEAR(q[7 * k + 2], 0, 1e-3) << "box " << k;
    }
  }
}

TEST(SurfaceContact, NothingTripsOverTheSeamOfFlushBoxes) {
  const double r = 0.02, stiffness = 1e8;
  Scene s;
  s.timestep = 1e-3;
  s.gravity = {0, 0, -9.81};
  s.links = {
      testing::link("left", JointType::fixed, {-0.1, 0, -0.05}, CuboidShape{{0.2, 0.1, 0.1}}, 500),
      testing::link("right", JointType::fixed, {0.1, 0, -0.05}, CuboidShape{{0.2, 0.1, 0.1}}, 500),
      testing::link("ball", JointType::free, {-0.05, 0, r}, SphereShape{r}, 500)};
  const ContactCoefficients law = {stiffness, stiffness / 100, 0.8, 10 * stiffness};
  for (const char* const box : {"left", "right"})
    add_surface_contact(s, {"ball", box, law, ContactLaw::clamped, 2.5e-4, {}});
  const Model model(s);
  Stepper stepper(model, testing::options(Integrator::bdf2, 1e-3, 1e-9));
  Batch batch(model, 1);
  batch.set_state(0, q_of(batch), std::vector<double>{0.2, 0, 0, 0, 0.2 / r, 0});
  for (int k = 0; k < 100; ++k) stepper.step(batch, {});
  const double depth = -q_of(batch)[2];
  double high = -1, low = 1;
  for (int k = 0; k < 300; ++k) {
    stepper.step(batch, {});
    high = std::max(high, q_of(batch)[2]);
    low = std::min(low, q_of(batch)[2]);
  }
  EXPECT_GT(q_of(batch)[0], 0.07) << "it starts 0.05 m before the seam";
  EXPECT_GT(depth, 0);
  EXPECT_LT(high - low, 0.02 * depth);
}

}  // namespace
}  // namespace tangere
