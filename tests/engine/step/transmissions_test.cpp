// SPDX-License-Identifier: Apache-2.0
// Tests transmissions: lengths of paths against closed forms, a swing on a cord, forces at points,
// energy, bits in batches, and gradients by three routes.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/start_overlaps.hpp"
#include "engine/sense/transmission_forces.hpp"
#include "tests/engine/effect_properties.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/gradient_tangent.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using Kind = PathPart::Kind;

/// A joint without mass for a transmission.
LinkDescription cord(const std::string& name) {
  LinkDescription l = link(name, JointType::prismatic, {0, 0, 0}, AbstractShape{}, 1);
  l.joint.name = name;
  l.joint.axis0 = {1, 0, 0};
  return l;
}

/// A ball of 0.5 kg that slides along x, and a cord from it to (0, 0.3, 0).
Scene slider() {
  Scene s;
  s.gravity = {0, 0, 0};
  const double r = 0.05;
  s.links = {link("ball", JointType::prismatic, {0, 0, 0}, SphereShape{r},
                  0.5 / (4.0 / 3 * M_PI * r * r * r)),
             cord("cord")};
  s.links[0].joint.axis0 = {1, 0, 0};
  TransmissionDescription d;
  d.joint = "cord";
  d.path = {{.body = "ball"}, {.position = {0, 0.3, 0}}};
  s.transmissions = {d};
  s.initial = {{"ball_joint", {0.2}, {0.1}, {}}};
  return s;
}

/// x″ = -k (ℓ - ℓ₀) x/(ℓ m), ℓ² = x² + 0.3², by Runge and Kutta in steps of 1e-5 s.
double slider_at(double time, double stiffness, double rest) {
  double q = 0.2, v = 0.1;
  const double h = 1e-5;
  const auto a = [&](double x) {
    const double l = std::hypot(x, 0.3);
    return -stiffness * (l - rest) * x / (l * 0.5);
  };
  for (int k = 0; k < static_cast<int>(std::lround(time / h)); ++k) {
    const double v1 = v, a1 = a(q), v2 = v + h / 2 * a1, a2 = a(q + h / 2 * v1),
                 v3 = v + h / 2 * a2, a3 = a(q + h / 2 * v2), v4 = v + h * a3, a4 = a(q + h * v3);
    q += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  return q;
}

TEST(Transmissions, SwingOnACordByClosedFormWithSecondOrder) {
  Scene s = slider();
  s.links[1].joint.stiffness = 80;
  s.links[1].joint.rest = {0.25};
  const Model model(s);
  const double truth = slider_at(0.4, 80, 0.25);
  for (const Integrator scheme : {Integrator::bdf2, Integrator::sdirk2}) {
    SCOPED_TRACE(to_string(scheme));
    const auto error = [&](double h) {
      Batch batch(model, 1);
      Stepper stepper(model, testing::options(scheme, h, 1e-13));
      for (int t = 0; t < static_cast<int>(std::lround(0.4 / h)); ++t) stepper.step(batch, {});
      const std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
      EXPECT_NEAR(q[1], std::hypot(q[0], 0.3), 1e-14);
      EXPECT_NEAR(v[1], q[0] * v[0] / q[1], 1e-14);
      return std::abs(q[0] - truth);
    };
    const double coarse = error(4e-3), fine = error(2e-3);
    EXPECT_LT(fine, 1e-3);
    EXPECT_NEAR(std::log2(coarse / fine), 2, 0.15) << coarse << " " << fine;
  }
}

/// The length of a path through `parts`, where the slider is at x = 0.2.
double length_through(const std::vector<PathPart>& parts) {
  Scene s = slider();
  s.transmissions[0].path = parts;
  const Model model(s);
  return model.initial_q()[1];
}

TEST(Transmissions, HaveTheLengthsOfTheirPaths) {
  const PathPart ball = {.body = "ball"};  // at (0.2, 0, 0)
  PathPart round = {.kind = Kind::cylinder, .radius = 0.05};
  const PathPart end = {.position = {-0.3, 0.01, 0}}, low = {.position = {-0.3, 0.01, 0.4}};
  const double t0 = std::sqrt(0.04 - 0.0025), t1 = std::sqrt(0.0901 - 0.0025);
  const double alphas = std::acos(0.05 / 0.2) + std::acos(0.05 / std::sqrt(0.0901));
  const double angle = M_PI - std::atan2(0.01, 0.3);
  const double above = t0 + t1 + 0.05 * (angle - alphas),
               below = t0 + t1 + 0.05 * (2 * M_PI - angle - alphas);
  EXPECT_NEAR(length_through({ball, end}), std::hypot(0.5, 0.01), 1e-15);
  EXPECT_NEAR(length_through({ball, round, end}), above, 1e-12);
  EXPECT_NEAR(length_through({ball, round, low}), std::hypot(above, 0.4), 1e-12);
  round.side = {0, -0.1, 0};
  EXPECT_NEAR(length_through({ball, round, end}), below, 1e-12);
  round.side = {0, 0.1, 0};
  EXPECT_NEAR(length_through({ball, round, end}), above, 1e-12);
  round.kind = Kind::sphere;
  EXPECT_NEAR(length_through({ball, round, end}), above, 1e-12);
  round.side.reset();
  round.position = {0, 0.3, 0};  // beside the way
  EXPECT_NEAR(length_through({ball, round, end}), std::hypot(0.5, 0.01), 1e-15);
  const PathPart half = {.kind = Kind::pulley, .divisor = 2}, up = {.position = {0.2, 0, 0.6}};
  EXPECT_NEAR(length_through({ball, end, half, ball, up}), std::hypot(0.5, 0.01) + 0.3, 1e-15);
}

/// A path's length is the coordinate of its joint from the start on, whatever <initial> says.
TEST(Transmissions, LengthsThatStartOutsideLimitsAreNamed) {
  Scene s = slider();
  const double length = Model(s).initial_q().back();
  JointDescription& cord = s.links.back().joint;
  cord.limit_stiffness = 10;
  EXPECT_TRUE(transmissions_outside_limits(Model(s)).empty());
  cord.limits = {length, length + 1};
  EXPECT_TRUE(transmissions_outside_limits(Model(s)).empty());
  cord.limits = {length + 0.01, length + 1};
  const std::vector<std::string> lines = transmissions_outside_limits(Model(s));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("'cord' starts at "), std::string::npos) << lines[0];
}

/// A force at a point of a hinged bar does the work of its lever; a force along axes of another
/// body has a length.
TEST(Transmissions, StartsInsideASurfaceAreNamed) {
  Scene s = slider();  // the ball starts at x = 0.2
  PathPart surface{.kind = Kind::sphere, .position = {0, 0.15, 0}};
  surface.radius = 0.02;
  s.transmissions[0].path.insert(s.transmissions[0].path.begin() + 1, surface);
  EXPECT_TRUE(paths_through_surfaces(Model(s)).empty());
  s.transmissions[0].path[1].position = {0.21, 0, 0};
  const std::vector<std::string> lines = paths_through_surfaces(Model(s));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("'cord' starts with a point 0.01 m from the middle"), std::string::npos)
      << lines[0];
}

TEST(Transmissions, ForcesActAtPoints) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("bar", JointType::revolute, {0, 0, 0}, CuboidShape{{0.2, 0.02, 0.02}, {}}, 500),
             cord("push"), cord("offset")};
  s.links[0].joint.axis0 = {0, 0, 1};
  TransmissionDescription push;
  push.kind = TransmissionDescription::Kind::wrench;
  push.joint = "push", push.body = "bar";
  push.position = {0.08, 0.01, 0};
  push.force = {0.5, 2, 0}, push.torque = {0, 3, 0.1};
  TransmissionDescription offset = push;
  offset.joint = "offset";
  offset.reference = "";
  offset.reference_position = {0.01, 0, 0};
  offset.torque = {};
  s.transmissions = {push, offset};
  s.motors = {{"push", -1, 1, {}}, {"offset", -1, 1, {}}};
  s.initial = {{"bar_joint", {0.3}, {0.7}, {}}};
  const double lever = 0.08 * 2 - 0.01 * 0.5 + 0.1, c = std::cos(0.3), n = std::sin(0.3);
  const double x = 0.08 * c - 0.01 * n, y = 0.08 * n + 0.01 * c, arm = 2 * x - 0.5 * y;
  const Model model(s);
  const std::vector<double> q = testing::q_of(Batch(model, 1)), v = testing::v_of(Batch(model, 1));
  EXPECT_EQ(q[1], 0);
  EXPECT_NEAR(v[1], 0.7 * lever, 1e-15);
  EXPECT_NEAR(q[2], 0.5 * (x - 0.01) + 2 * y, 1e-15);
  EXPECT_NEAR(v[2], 0.7 * arm, 1e-15);
  const double mass = 500 * 0.2 * 0.02 * 0.02, inertia = mass * (0.2 * 0.2 + 0.02 * 0.02) / 12;
  for (const std::vector<double>& u : {std::vector<double>{0.5, 0}, std::vector<double>{0, 0.5}}) {
    Batch batch(model, 1);
    Stepper stepper(model, testing::options(Integrator::bdf1, 1e-6));
    stepper.step(batch, u);
    const double torque = u[0] * lever + u[1] * arm;
    EXPECT_NEAR((testing::v_of(batch)[0] - 0.7) / 1e-6, torque / inertia, 2e-5 * torque / inertia);
  }
}

/// By the sum of its parts, and by the acceleration that it gives the ball.
TEST(Transmissions, SayTheirForces) {
  Scene s = slider();
  JointDescription& joint = s.links[1].joint;
  joint.stiffness = 80;
  joint.rest = {0.25};
  joint.damping = 0.4;
  joint.limits = {0, 0.35};
  joint.limit_stiffness = 50;
  joint.friction = 0.7;
  s.motors.push_back({"cord", -3, 3, {}});
  MotorDescription servo{"cord", -0.5, 0.5, {}};
  servo.control = MotorControl::position;
  servo.P = 4, servo.D = 0.2;
  s.motors.push_back(servo);
  s.motors.back().name = "servo";
  const Model model(s);
  Batch batch(model, 2);
  const std::vector<double> u = {0.2, 0.3, 0.2, 0.3};
  EXPECT_EQ(transmission_forces(model, Batch(model, 1), 0, std::span(u).first(2)).size(), 1U);
  constexpr double h = 1e-5;
  Stepper stepper(model, testing::options(Integrator::sdirk2, h, 1e-13));
  for (int t = 0; t < 600; ++t) stepper.step(batch, u);  // until friction slips
  const std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
  ASSERT_GT(q[1], 0.35);
  ASSERT_GT(v[1], 1e-2);
  const double expected = 80 * (0.25 - q[1]) - 0.4 * v[1] - 50 * (q[1] - 0.35) - 0.7 + 0.2 * 3 +
                          std::clamp(4 * (0.3 - q[1]) - 0.2 * v[1], -0.5, 0.5);
  const double force = transmission_forces(model, batch, 1, std::span(u).last(2)).at(0);
  EXPECT_NEAR(force, expected, 1e-12);
  stepper.step(batch, u);
  const double after = transmission_forces(model, batch, 1, std::span(u).last(2)).at(0);
  const double acceleration = (testing::v_of(batch)[0] - v[0]) / h;
  EXPECT_NEAR(0.5 * acceleration, 0.5 * (force + after) * q[0] / q[1], 1e-4);
  EXPECT_THROW(transmission_forces(model, batch, 2, std::span(u).first(2)), InputError);
  EXPECT_THROW(transmission_forces(model, batch, 0, u), InputError);
}

TEST(Transmissions, BalanceTheirEnergy) {
  Scene s = slider();
  s.links[1].joint.stiffness = 80;
  s.links[1].joint.rest = {0.25};
  s.links[1].joint.damping = 0.4;
  s.links[1].joint.armature = 0.2;
  const Model model(s);
  const testing::EnergyLoss energy = testing::energy_loss(model);
  EXPECT_GT(energy.taken, 1e-4);
  EXPECT_NEAR(energy.lost, energy.taken, 1e-3 * energy.taken);
}

TEST(Transmissions, HaveTheSameBitsAloneAndInABatch) {
  Scene scene = testing::random_machine(4, 6);
  testing::add_transmissions(scene, 4, 4);
  ASSERT_GE(scene.transmissions.size(), 3U);
  const std::string& joint = scene.transmissions[0].joint;
  scene.randomizations.push_back({{NumberOwner::joint, NumberField::damping, joint},
                                  {Distribution::Kind::uniform, 0.1, 1, {}},
                                  {}});
  const Model model(scene);
  testing::expect_bits_of_lone_environments(model, 4);
}

/// Paths, wrenches, limits, armature and dry friction of transmissions, and motors at the start of
/// the step.
Scene machine_with_cords(unsigned seed) {
  Scene scene = testing::random_machine(seed, 3 + static_cast<int>(seed % 3));
  testing::add_transmissions(scene, seed, 3);
  testing::Random random(seed);
  for (LinkDescription& l : scene.links)
    if (is_transmission(scene, l.joint)) l.joint.friction = random.uniform(0.01, 0.1);
  for (MotorDescription& m : scene.motors)
    if (m.joint == "cord1") m.timing = MotorTiming::start;
  return scene;
}

class TransmissionsBySchemes : public ::testing::TestWithParam<Integrator> {};

TEST_P(TransmissionsBySchemes, GradientsMatchDifferencesAndTangents) {
  int compared = 0, runs = 0;
  for (unsigned seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene = machine_with_cords(seed);
    if (scene.transmissions.empty() || testing::splits(scene, GetParam(), seed, 3)) continue;
    compared += testing::check_gradient(scene, GetParam(), seed, 3, 1e-6);
    const Model model(scene);
    runs += testing::check_tangent(model, testing::options(GetParam(), scene.timestep, 1e-13),
                                   testing::random_input(model, seed, 3), seed);
  }
  EXPECT_GT(compared, 80);
  EXPECT_GE(runs, 1);
}

INSTANTIATE_TEST_SUITE_P(Schemes, TransmissionsBySchemes,
                         ::testing::Values(Integrator::bdf2, Integrator::sdirk2));

TEST(TransmissionFaults, SayWhatWasExpected) {
  const auto fault = [](const auto& change) { return testing::fault_of_model(slider(), change); };
  const auto has = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  has(fault([](Scene& s) {
        s.transmissions.push_back(s.transmissions[0]);
        s.transmissions[1].joint = "rope";
      }),
      "no joint is named 'rope'");
  has(fault([](Scene& s) { s.transmissions[0].path[0].body = "cube"; }), "no body is named 'cube'");
  has(fault([](Scene& s) { s.transmissions[0].path.pop_back(); }), "expected points at both ends");
  has(fault([](Scene& s) { s.transmissions[0].path[0].body = ""; }), "no degree of freedom");
  has(fault([](Scene& s) { s.links[1].body.shape = SphereShape{0.1}; }), "moves a body");
  has(fault([](Scene& s) {
        s.transmissions.push_back(s.transmissions[0]);
        s.transmissions[1].joint = "ball_joint";
      }),
      "names body 'ball' of a transmission");
  has(fault([](Scene& s) { s.transmissions.push_back(s.transmissions[0]); }), "given twice");
  has(fault([](Scene& s) {
        auto& path = s.transmissions[0].path;
        path.insert(path.begin(), {.kind = Kind::sphere, .radius = 0.1});
      }),
      "expected points before and after");
  has(fault([](Scene& s) {
        auto& path = s.transmissions[0].path;
        path.insert(path.begin() + 1, {.kind = Kind::sphere, .radius = 0.1, .side = Vector3{}});
      }),
      "expected one outside of it");
  has(fault([](Scene& s) {
        s.initial.push_back({"cord", {0.5}, {}, {}});
      }),
      "expected no start of its own");
  has(fault([](Scene& s) {
        s.transmissions[0].path.insert(s.transmissions[0].path.begin() + 1,
                                       {.kind = Kind::sphere, .radius = -1});
      }),
      "expected a positive number");
}

}  // namespace
}  // namespace tangere
