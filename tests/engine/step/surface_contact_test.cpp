// SPDX-License-Identifier: Apache-2.0
// Contacts of whole surfaces: areas, closed forms, and bodies that roll, stack, rest and tumble.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/engine/surface_scenes.hpp"

namespace tangere {
namespace {

using testing::above;
using testing::kAlongX;
using testing::kAlongY;
using testing::kPi;
using testing::kUpright;
using testing::lift;
using testing::mesh_of;
using testing::q_of;
using testing::turned;
using testing::v_of;

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
  EXPECT_TRUE(add_surface_contact(s, {"roll",
                                      "ground",
                                      {stiffness, stiffness / 100, 0.8, stiffness / 10},
                                      ContactLaw::clamped,
                                      {},
                                      {}})
                  .empty());
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

/// Steps a scene for a time at its own step.
void settle(const Model& model, Batch& batch, double time) {
  Stepper stepper(model, testing::options(Integrator::bdf2, model.scene().timestep, 1e-9));
  for (int k = 0; k < int(std::round(time / model.scene().timestep)); ++k) stepper.step(batch, {});
  ASSERT_FALSE(failed(batch.status(0)));
}

TEST(SurfaceContact, ARodOnTwoSupportsSharesItsWeightByTheLever) {
  const double r = 0.01, l = 0.2, K = 1e8, width = 0.01, left = -0.08, right = 0.04;
  Scene s;
  s.timestep = 1e-3;
  s.gravity = {0, 0, -9.81};
  s.links = {testing::link("left", JointType::fixed, {left, 0, -0.02},
                           CuboidShape{{width, 0.1, 0.04}}, 500),
             testing::link("right", JointType::fixed, {right, 0, -0.02},
                           CuboidShape{{width, 0.1, 0.04}}, 500),
             testing::link("rod", JointType::free, {0, 0, r}, CylinderShape{l, r}, 2000)};
  s.links[2].body.pose.orientation = kAlongX;
  for (const char* const support : {"left", "right"})
    add_surface_contact(s,
                        {"rod", support, {K, K / 100, 0.5, 10 * K}, ContactLaw::clamped, 5e-4, {}});
  const Model model(s);
  Batch batch(model, 1);
  settle(model, batch, 0.5);
  const std::vector<double> q = q_of(batch);
  const double tilt = 2 * q[5];  // small: the quaternion's y is half the angle about y
  const double weight = 9.81 * 2000 * kPi * r * r * l;
  const auto sunk = [&](double share) {
    return std::pow(share * weight / (4.0 / 3 * K * width * std::sqrt(2 * r)), 2.0 / 3);
  };
  // The axis passes through the middle at height q[2] and falls along x by the tilt.
  EXPECT_NEAR(-(q[2] - tilt * left), sunk(right / (right - left)), 0.05 * sunk(0.5));
  EXPECT_NEAR(-(q[2] - tilt * right), sunk(-left / (right - left)), 0.05 * sunk(0.5));
}

TEST(SurfaceContact, ABallComesToRestInABowlThatIsAMesh) {
  MeshShape bowl = testing::turned_mesh(
      {{-0.03, 0.04}, {0.01, 0.07}, {0.01, 0.06}, {-0.02, 0.03}, {-0.022, 0.01}}, 24);
  Scene s;
  s.timestep = 1e-3;
  s.gravity = {0, 0, -9.81};
  s.links = {testing::link("bowl", JointType::fixed, {0, 0, 0}, mesh_of(bowl, 48), 1000),
             testing::link("ball", JointType::free, {0.025, 0.01, 0.03}, SphereShape{0.015}, 500)};
  EXPECT_TRUE(
      add_surface_contact(s, {"ball", "bowl", {1e8, 1e5, 0.3, 1e9}, ContactLaw::clamped, {}, {}})
          .empty());
  const Model model(s);
  Batch batch(model, 1);
  settle(model, batch, 3);
  const std::vector<double> q = q_of(batch);
  EXPECT_LT(std::hypot(0.025 + q[0], 0.01 + q[1]), 0.03);
  EXPECT_NEAR(0.03 + q[2], -0.022 + 0.015, 0.003);
}

TEST(SurfaceContact, ShearSpringsHoldEveryShapeOnASlope) {
  struct Case {
    Shape shape;
    Quaternion turn;
    double height;
  };
  const double r = 0.02;
  const std::vector<Case> cases = {
      {CuboidShape{{0.06, 0.05, 0.04}}, kUpright, 0.02},
      {CylinderShape{0.04, 0.03}, kUpright, 0.02},
      {CylinderShape{0.1, r}, kAlongX, r},
      {CapsuleShape{0.1, r}, kAlongX, r},
      {mesh_of(testing::cuboid_mesh({0.03, 0.025, 0.02})), kUpright, 0.02}};
  for (const Case& c : cases) {
    SCOPED_TRACE(shape_name(c.shape));
    Scene scene = on_slope(c.shape, c.turn, c.height, 1e8);
    for (PairContactDescription& contact : scene.pair_contacts) contact.coefficients.ks = 5e7;
    const Model model(scene);
    Batch batch(model, 1);
    settle(model, batch, 0.5);
    const std::vector<double> before = q_of(batch);
    settle(model, batch, 1);
    EXPECT_NEAR(q_of(batch)[0], before[0], 1e-6) << "it creeps";
    EXPECT_LT(before[0], 1e-3);
  }
}

TEST(SurfaceContact, CreatesNoEnergyWhereBodiesTumbleAndRock) {
  const std::vector<Shape> shapes = {CuboidShape{{0.06, 0.04, 0.03}},
                                     CylinderShape{0.01, 0.04},
                                     CapsuleShape{0.05, 0.01},
                                     EllipsoidShape{{0.03, 0.05, 0.08}},
                                     SphereShape{0.02},
                                     mesh_of(testing::cuboid_mesh({0.02, 0.03, 0.02}))};
  for (const Shape& shape : shapes) {
    SCOPED_TRACE(shape_name(shape));
    Scene scene = on_slope(shape, kUpright, 0.08, 1e8);
    scene.gravity = {0, 0, -9.81};
    for (PairContactDescription& contact : scene.pair_contacts) contact.coefficients.damping = 0;
    const Model model(scene);
    Stepper stepper(model, testing::options(Integrator::bdf2, 1e-3, 1e-9));
    Batch batch(model, 1);
    const Quaternion lean = turned({1, 0.4, 0.2}, 0.5);
    batch.set_state(0, std::vector<double>{0, 0, 0, lean[0], lean[1], lean[2], lean[3]},
                    std::vector<double>{0.1, 0, 0, 3, -2, 20});
    const MassProperties mass = mass_properties(shape, 500);
    const auto energy = [&] {
      const std::vector<double> q = q_of(batch), v = v_of(batch);
      double sum = mass.mass * 9.81 * q[2];
      for (std::size_t k = 0; k < 3; ++k)
        sum += 0.5 * mass.mass * v[k] * v[k] + 0.5 * mass.inertia.m[k][k] * v[3 + k] * v[3 + k];
      return sum;
    };
    // What the springs hold is not in the sum, so it may fall and rise, but not above the start.
    const double start = energy(), scale = start + mass.mass * 9.81 * 0.08;
    for (int k = 0; k < 1500; ++k) {
      stepper.step(batch, {});
      ASSERT_FALSE(failed(batch.status(0)));
      ASSERT_LT(energy(), start + 1e-3 * scale) << "step " << k;
    }
  }
}

TEST(SurfaceContact, ABodyThatWouldNeedTooManyPointsHasNone) {
  for (const Shape& large : {Shape{CuboidShape{{1, 1, 0.05}}}, Shape{CylinderShape{1, 0.5}}}) {
    SCOPED_TRACE(shape_name(large));
    const bool drum = std::holds_alternative<CylinderShape>(large);
    Scene s;
    s.timestep = 1e-3;
    s.gravity = {0, 0, -9.81};
    s.links = {testing::link("large", JointType::fixed, {0, 0, drum ? -0.5 : -0.025}, large, 500),
               testing::link("die", JointType::free, {0.0013, 0.0021, 0.005},
                             CuboidShape{{0.01, 0.01, 0.01}}, 1000)};
    if (drum) s.links[0].body.pose.orientation = kAlongX;
    EXPECT_TRUE(
        add_surface_contact(s, {"large", "die", {1e8, 1e6, 0.5, 1e8}, ContactLaw::clamped, {}, {}})
            .empty());
    ASSERT_EQ(s.pair_contacts.size(), 1U);
    EXPECT_EQ(s.pair_contacts[0].general_body, "die");
    const Model model(s);
    Batch batch(model, 1);
    settle(model, batch, 1);
    const std::vector<double> q = q_of(batch);
    // On the plate it sinks in by m g/(K A), on the drum along a line.
    EXPECT_NEAR(q[2], -1000 * 0.01 * 9.81 / 1e8, drum ? 2e-5 : 1e-8);
    for (const std::size_t k : {0, 1}) EXPECT_NEAR(q[k], 0, drum ? 1e-4 : 1e-8);
    for (const std::size_t k : {4, 5, 6}) EXPECT_NEAR(q[k], 0, drum ? 5e-3 : 1e-6);
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
    add_surface_contact(s, {"ball", box, law, ContactLaw::clamped, 5e-4, {}});
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
