// SPDX-License-Identifier: Apache-2.0
// Balls that touch other bodies with their surface: as on the ground, around edges and corners, and
// each other. Random scenes with balls are in the tests of Jacobians, gradients and lanes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/scene/scene_number.hpp"
#include "engine/sense/start_overlaps.hpp"
#include "kernels/numbers/linalg.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::q_of;
using testing::v_of;

constexpr double kBallRadius = 0.03, kBallStiffness = 2000;
const ContactCoefficients kBallLaw{kBallStiffness, 2, 0.4, 5};

/// A ball of 1000 kg/m³ at `at`, and what it touches, fixed in the world around the origin.
Scene ball_at(const Vector3& at, const Shape& touched) {
  Scene s;
  s.timestep = 1e-3;
  s.links.push_back(testing::link("ball", JointType::free, at, SphereShape{kBallRadius}, 1000));
  s.links.push_back(testing::link("touched", JointType::fixed, {0, 0, 0}, touched, 1000));
  s.pair_contacts.push_back({"ball", "touched", kBallLaw, ContactLaw::linear, 1e-5, {}});
  return s;
}

/// Throws the ball with a spin, and returns its places of a second.
std::vector<std::vector<double>> played(const Scene& scene) {
  const Model model(scene);
  Stepper stepper(model, testing::options(Integrator::sdirk2, scene.timestep, 1e-12));
  Batch batch(model, 1);
  batch.set_state(0, q_of(batch), std::vector<double>{0.3, -0.1, -0.2, 3, 8, -2});
  std::vector<std::vector<double>> run;
  for (int k = 0; k < 1000; ++k) {
    stepper.step(batch, {});
    run.push_back(q_of(batch));
  }
  return run;
}

void expect_near(const std::vector<std::vector<double>>& a,
                 const std::vector<std::vector<double>>& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k)
    for (std::size_t i = 0; i < a[k].size(); ++i)
      ASSERT_NEAR(a[k][i], b[k][i], tolerance) << "step " << k << ", coordinate " << i;
}

TEST(BallContact, IsThatOfTheGround) {
  Scene ground = ball_at({0, 0, 0.04}, PlaneShape{});
  ground.pair_contacts.clear();
  ground.ground = GroundDescription{};
  ground.ground_contacts.push_back({"ball", kBallLaw, ContactLaw::linear, 1e-5, {}});
  const auto on_ground = played(ground);
  EXPECT_LT(on_ground.back()[2], 0) << "it fell by a centimetre, and lies";
  // On the ground velocities are compared where the ball is deepest. On a body they are compared on
  // its surface, which at rest is 0.6 mm nearer to the centre.
  const auto on_plane = played(ball_at({0, 0, 0.04}, PlaneShape{}));
  const double way = std::hypot(on_ground.back()[0], on_ground.back()[1]);
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(on_plane.back()[std::size_t(k)], on_ground.back()[std::size_t(k)], 0.02 * way);
  // The upper face of a box, a cylinder that lies on z, and a far larger ball.
  const auto lowered = [](const Shape& touched, double by) {
    Scene s = ball_at({0, 0, 0.04}, touched);
    s.links[1].joint.pose.position = {0, 0, -by};
    return played(s);
  };
  expect_near(lowered(CuboidShape{{4, 4, 0.2}, {2, 2, 2}}, 0.1), on_plane, 1e-8);
  expect_near(lowered(CylinderShape{0.2, 4, 4, 1}, 0.1), on_plane, 1e-8);
  expect_near(lowered(SphereShape{1e5}, 1e5), on_plane, 1e-4);
}

/// The acceleration that the touch gives the ball at once.
kernels::Vec3<double> pushed(const Scene& scene) {
  const Model model(scene);
  Stepper stepper(model, testing::options(Integrator::bdf1, 1e-6, 1e-12));
  Batch batch(model, 1);
  stepper.step(batch, {});
  const std::vector<double> v = v_of(batch);
  return (1 / 1e-6) * kernels::Vec3<double>{v[0], v[1], v[2]};
}

TEST(BallContact, ActsFromTheNearestPlaceOfAShape) {
  const Shape box = CuboidShape{{0.2, 0.3, 0.4}, {2, 2, 2}};
  constexpr double kPressed = 1e-3;
  const double mass = 4.0 / 3 * M_PI * kBallRadius * kBallRadius * kBallRadius * 1000;
  struct Case {
    Shape touched;
    kernels::Vec3<double> nearest, normal;
  };
  const double third = 1 / std::sqrt(3.0);
  const Case cases[] = {
      {box, {0.1, 0.02, -0.05}, {1, 0, 0}},                                   // a face
      {box, {0.1, -0.15, 0.07}, {0.6, -0.8, 0}},                              // an edge
      {box, {-0.1, 0.15, 0.2}, {-third, third, third}},                       // a corner
      {CylinderShape{0.2, 0.1, 4, 1}, {0.06, 0.08, 0.1}, {0.36, 0.48, 0.8}},  // a rim
      {CapsuleShape{0.2, 0.1, 2, 4}, {0, 0.06, 0.18}, {0, 0.6, 0.8}},         // an end
      {SphereShape{0.1}, {0, 0.06, 0.08}, {0, 0.6, 0.8}},
      {EllipsoidShape{{0.2, 0.3, 0.4}, 20}, {0, 0, 0.2}, {0, 0, 1}},
  };
  for (const Case& c : cases) {
    const kernels::Vec3<double> centre = c.nearest + (kBallRadius - kPressed) * c.normal;
    Scene s = ball_at({centre.x, centre.y, centre.z}, c.touched);
    s.gravity = {0, 0, 0};
    const kernels::Vec3<double> a = pushed(s),
                                expected = (kBallStiffness * kPressed / mass) * c.normal;
    const double scale = std::sqrt(dot(expected, expected));
    EXPECT_NEAR(a.x, expected.x, 1e-4 * scale) << shape_name(c.touched);
    EXPECT_NEAR(a.y, expected.y, 1e-4 * scale) << shape_name(c.touched);
    EXPECT_NEAR(a.z, expected.z, 1e-4 * scale) << shape_name(c.touched);
    const std::vector<std::string> deep = start_overlaps(Model(s));
    EXPECT_TRUE(deep.empty()) << "a thirtieth of the radius is a touch";
  }
  Scene inside = ball_at({0.05, 0, 0}, box);
  EXPECT_EQ(start_overlaps(Model(inside)).size(), 1U);
}

TEST(BallContact, OfTwoBallsIsTheSameBothWays) {
  const auto collide = [](bool swapped) {
    Scene s;
    s.timestep = 1e-4;
    s.gravity = {0, 0, 0};
    s.links.push_back(testing::link("a", JointType::free, {0, 0, 0}, SphereShape{0.03}, 1000));
    s.links.push_back(testing::link("b", JointType::free, {0.06, 0.03, 0}, SphereShape{0.02}, 900));
    s.pair_contacts.push_back({swapped ? "b" : "a",
                               swapped ? "a" : "b",
                               {kBallStiffness, 0, 0, 0},
                               ContactLaw::linear,
                               1e-5,
                               {}});
    const Model model(s);
    Stepper stepper(model, testing::options(Integrator::sdirk3, s.timestep, 1e-12));
    Batch batch(model, 1);
    std::vector<double> v(12);
    v[0] = 0.5;
    batch.set_state(0, q_of(batch), v);
    for (int k = 0; k < 2000; ++k) stepper.step(batch, {});
    std::vector<double> now = v_of(batch);
    const double before = model.mass(0) * 0.5,
                 after = model.mass(0) * now[0] + model.mass(1) * now[6];
    EXPECT_NEAR(after, before, 1e-9 * before);
    EXPECT_GT(now[7], 0.01) << "b was hit and went aside";
    double energy = 0;
    for (int k = 0; k < 3; ++k)
      energy += model.mass(0) * now[std::size_t(k)] * now[std::size_t(k)] +
                model.mass(1) * now[std::size_t(6 + k)] * now[std::size_t(6 + k)];
    EXPECT_NEAR(energy, 0.25 * model.mass(0), 1e-3 * energy);
    return now;
  };
  const std::vector<double> a = collide(false), b = collide(true);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-9) << i;
}

TEST(BallContact, BallsRollOnABoxThatIsPushed) {
  // The box's acceleration A is that of the ball, a, and of its surface: a (1 + m s²/I) = A, where
  // the ball's centre is s above the box.
  Scene s;
  s.timestep = 1e-3;
  s.links.push_back(testing::link("box", JointType::prismatic, {0, 0, -0.05},
                                  CuboidShape{{2, 1, 0.1}, {2, 2, 2}}, 10));  // 2 kg
  s.links[0].joint.axis0 = {1, 0, 0};
  s.links.push_back(
      testing::link("ball", JointType::free, {0, 0, kBallRadius}, SphereShape{kBallRadius}, 1000));
  s.pair_contacts.push_back({"ball", "box", {1e4, 1e3, 0.8, 20}, ContactLaw::linear, 1e-5, {}});
  MotorDescription motor;
  motor.joint = s.links[0].joint.name;
  motor.low = -10, motor.high = 10;
  s.motors.push_back(motor);
  const Model model(s);
  Stepper stepper(model, testing::options(Integrator::sdirk2, s.timestep, 1e-10));
  Batch batch(model, 1);
  for (int k = 0; k < 500; ++k) stepper.step(batch, std::vector<double>{0.1});
  const std::vector<double> v = v_of(batch);
  const double m = model.mass(1), push = 1.0;
  const double height = (kBallRadius - m * 9.8 / 1e4) / kBallRadius;
  const double share = 1 / (1 + 2.5 * height * height);  // about 2/7
  const double box = push / (model.mass(0) + share * m);
  EXPECT_NEAR(v[0], 0.5 * box, 1e-4 * box);
  EXPECT_NEAR(v[1], 0.5 * share * box, 1e-4 * box);
}

TEST(BallContact, AFastOneDoesNotPassUnnoticed) {
  // The small ball is far beside the middle of the large one, whichever of them is the general one.
  for (const bool swapped : {false, true}) {
    Scene s;
    s.timestep = 5e-3;
    s.gravity = {0, 0, 0};
    s.links.push_back(testing::link("large", JointType::fixed, {0, 0, 0}, SphereShape{0.5}, 1000));
    s.links.push_back(
        testing::link("small", JointType::free, {-1, 0.2, 0}, SphereShape{0.01}, 1000));
    s.pair_contacts.push_back({swapped ? "small" : "large",
                               swapped ? "large" : "small",
                               {100, 0, 0, 0},
                               ContactLaw::linear,
                               1e-5,
                               {}});
    const Model model(s);
    Stepper stepper(model, testing::options(Integrator::bdf1, s.timestep, 1e-9));
    Batch batch(model, 1);
    batch.set_state(0, q_of(batch), std::vector<double>{400, 0, 0, 0, 0, 0});
    stepper.step(batch, {});
    EXPECT_GT(q_of(batch)[0], 0.9) << "its parts feel the contact, which is too soft";
    EXPECT_EQ(batch.status(0), StepStatus::tunnelled) << swapped;
  }
}

TEST(BallContact, SaysWhatItCannotDo) {
  const auto message = [](const Scene& scene) {
    try {
      const Model model(scene);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  MeshShape touched = testing::ellipsoid_mesh(1, {0.1, 0.1, 0.1});
  touched.resolution = 8;
  const Scene mesh = ball_at({0, 0, 0.2}, touched);
  EXPECT_NE(message(mesh).find("expected <surface_contact>"), std::string::npos) << message(mesh);
  Scene varying = ball_at({0, 0, 0.2}, PlaneShape{});
  RandomizationDescription radius;
  radius.number = size_of_body("ball", 0);
  radius.distribution.a = 0.02, radius.distribution.b = 0.03;
  varying.randomizations.push_back(radius);
  EXPECT_NE(message(varying).find("not where the sphere touches 'touched' with its surface"),
            std::string::npos)
      << message(varying);
  Scene elastic = ball_at({0, 0, 0.2}, PlaneShape{});
  elastic.pair_contacts[0].coefficients.ks = 10;
  EXPECT_NE(message(elastic).find("ks of the sphere 'ball'"), std::string::npos)
      << message(elastic);
}

}  // namespace
}  // namespace tangere
