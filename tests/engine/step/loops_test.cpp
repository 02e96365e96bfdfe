// SPDX-License-Identifier: Apache-2.0
// Tests closed loops: a linkage against its closed form, the force of a spring, orders, bits in
// batches, and gradients by three routes.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/sense/loop_readings.hpp"
#include "tests/engine/effect_properties.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/gradient_tangent.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;

/// Two cranks of 0.3 m on the ground, 0.4 m apart, and a bar between their tips: a parallelogram
/// whose bar never turns, so that it moves as a pendulum of one coordinate. The bar hangs on the
/// first crank, and a loop closes it with the second.
Scene parallelogram(double damping_time) {
  Scene s;
  s.name = "parallelogram";
  const Shape rod = CuboidShape{{0.02, 0.02, 0.3}, {2, 2, 2}};
  s.links = {
      link("left", JointType::revolute, {0, 0, 1}, rod, 2000),
      link("bar", JointType::revolute, {0, 0, -0.3}, CuboidShape{{0.4, 0.02, 0.02}, {}}, 1500),
      link("right", JointType::revolute, {0.4, 0, 1}, rod, 2000)};
  for (LinkDescription& l : s.links) l.joint.axis0 = {0, 1, 0};
  s.links[0].body.pose.position = s.links[2].body.pose.position = {0, 0, -0.15};
  s.links[1].parent = 0;
  s.links[1].body.pose.position = {0.2, 0, 0};
  s.initial = {{"left_joint", {0.7}, {0.4}, {}},
               {"bar_joint", {-0.7}, {-0.4}, {}},
               {"right_joint", {0.7}, {0.4}, {}}};
  LoopDescription loop;
  loop.name = "pin";
  loop.body1 = "bar", loop.body2 = "right";
  loop.position1 = {0.2, 0, 0};
  loop.stiffness = 1e6;
  loop.damping = damping_time * loop.stiffness;
  s.loops.push_back(loop);
  return s;
}

/// θ″ = -g (m/2 + m/2 + M) L sin θ / (2 m L²/3 + 2 m (0.02² + 0.02²)/12 … + M L²): the angle of the
/// cranks after a time, by Runge and Kutta in steps of 1e-5 s.
double closed_form(double time) {
  const double L = 0.3, m = 2000 * 0.02 * 0.02 * 0.3, M = 1500 * 0.4 * 0.02 * 0.02;
  const double about_end = m * (L * L + 0.02 * 0.02) / 12 + m * L * L / 4;
  const double ratio = 9.8 * L * (m + M) / (2 * about_end + M * L * L);
  double q = 0.7, v = 0.4;
  const double h = 1e-5;
  const auto a = [&](double x) { return -ratio * std::sin(x); };
  for (int k = 0; k < static_cast<int>(std::lround(time / h)); ++k) {
    const double v1 = v, a1 = a(q), v2 = v + h / 2 * a1, a2 = a(q + h / 2 * v1),
                 v3 = v + h / 2 * a2, a3 = a(q + h / 2 * v2), v4 = v + h * a3, a4 = a(q + h * v3);
    q += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  return q;
}

/// Largest error of both cranks after 0.4 s.
double error_of(const Scene& scene, Integrator scheme, double h) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(scheme, h, 1e-13));
  for (int t = 0; t < static_cast<int>(std::lround(0.4 / h)); ++t) {
    stepper.step(batch, {});
    EXPECT_FALSE(failed(batch.status(0))) << to_string(batch.status(0));
  }
  const double truth = closed_form(0.4);
  const std::vector<double> q = testing::q_of(batch);
  return std::max(std::abs(q[0] - truth), std::abs(q[2] - truth));
}

TEST(Loops, MoveAsTheLinkageDoesWithSecondOrder) {
  for (const Integrator scheme : {Integrator::bdf2, Integrator::sdirk2}) {
    SCOPED_TRACE(to_string(scheme));
    Scene scene = parallelogram(0.02);
    scene.loops[0].stiffness *= 100;  // its own length must not show
    scene.loops[0].damping *= 100;
    const double coarse = error_of(scene, scheme, 4e-3), fine = error_of(scene, scheme, 2e-3);
    EXPECT_LT(fine, 2e-3);
    EXPECT_NEAR(std::log2(coarse / fine), 2, 0.15) << coarse << " " << fine;
  }
}

TEST(Loops, StayClosedAndSayWhatTheyHold) {
  const Model model(parallelogram(0.02));
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(Integrator::bdf2, 1e-3));
  double most = 0;
  for (int t = 0; t < 400; ++t) {
    stepper.step(batch, {});
    const LoopReading r = loop_readings(model, batch, 0).at(0);
    most = std::max(most, r.gap);
    EXPECT_GT(r.force, 0);
  }
  EXPECT_LT(most, 1e-5);
  EXPECT_TRUE(open_loops(model).empty());
  Scene open = parallelogram(0.02);
  open.initial[2].q = {0.75};
  open.loops[0].position2 = {0, 0, -0.15};
  const std::vector<std::string> lines = open_loops(Model(open));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NE(lines[0].find("'pin' starts open by 0.015 m"), std::string::npos) << lines[0];
}

/// A mass that a connect holds under a fixed body sinks by m g/k and swings with √(k/m).
TEST(Loops, HoldAWeightAtItsSpringsLength) {
  Scene s;
  s.links = {link("mass", JointType::free, {0, 0, 0}, SphereShape{0.05}, 1000)};
  LoopDescription d;
  d.name = "hook";
  d.body1 = "mass";
  d.stiffness = 2e3;
  d.damping = 40;
  s.loops = {d};
  const Model model(s);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(Integrator::bdf1, 5e-3));
  for (int t = 0; t < 2000; ++t) stepper.step(batch, {});
  const double weight = 9.8 * 1000 * 4.0 / 3 * M_PI * 0.05 * 0.05 * 0.05;
  const LoopReading r = loop_readings(model, batch, 0).at(0);
  EXPECT_NEAR(testing::q_of(batch)[2], -weight / 2e3, 1e-9);
  EXPECT_NEAR(r.gap, weight / 2e3, 1e-9);
  EXPECT_NEAR(r.force, weight, 1e-6);
}

/// A bar that is welded to the world by its end turns by torque over stiffness.
TEST(Loops, WeldsHoldTorques) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("bar", JointType::free, {0.2, 0.1, 0}, CuboidShape{{0.4, 0.04, 0.02}, {}}, 800),
             link("hinge", JointType::revolute, {0, 0, 0}, SphereShape{0.05}, 1000)};
  s.links[1].joint.axis0 = {0.6, 0, 0.8};
  LoopDescription d;
  d.name = "weld";
  d.weld = true;
  d.body1 = "bar", d.body2 = "hinge";
  d.position1 = {-0.2, 0, 0};
  d.stiffness = 5e3, d.damping = 50;
  d.turning_stiffness = 20, d.turning_damping = 2;
  s.loops = {d};
  s.motors.push_back({"hinge_joint", -4, 4, {}});
  // Held by the world as well, so that the torque of the motor passes through both welds.
  d.name = "base";
  d.body1 = "bar", d.body2.clear();
  d.position1 = {0, 0, 0};
  s.loops.push_back(d);
  const Model model(s);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(Integrator::bdf1, 1e-2));
  for (int t = 0; t < 3000; ++t) stepper.step(batch, std::vector<double>{0.5});
  const std::vector<LoopReading> r = loop_readings(model, batch, 0);
  EXPECT_NEAR(r[0].torque / 20, r[0].turn, 1e-9);
  EXPECT_NEAR(r[1].torque / 20, r[1].turn, 1e-9);
  EXPECT_GT(r[0].turn, 0.01);
  // The moment of all that acts on the hinge about its axis is that of the motor.
  EXPECT_NEAR(testing::v_of(batch)[6], 0, 1e-9);
}

/// The balance of energy closes: what motors and gravity put in, dampers take.
/// A weld that starts half a turn away, about any axis, is open by π and pulls.
TEST(Loops, WeldsHalfATurnAwayAreOpen) {
  for (const Quaternion& turn : {Quaternion{0, 1, 0, 0}, Quaternion{0, 0, 1, 0},
                                 Quaternion{0, 0, 0, 1}, Quaternion{0, 0.6, 0, -0.8}}) {
    Scene s;
    s.links = {link("box", JointType::free, {0, 0, 1}, CuboidShape{{0.1, 0.2, 0.3}, {}}, 1000)};
    LoopDescription weld;
    weld.name = "weld";
    weld.body1 = "box";
    weld.weld = true;
    weld.orientation2 = turn;
    weld.stiffness = 1e5;
    weld.turning_stiffness = 7;
    s.loops.push_back(weld);
    const Model model(s);
    const LoopReading r = loop_readings(model, Batch(model, 1), 0).at(0);
    EXPECT_NEAR(r.turn, std::acos(-1.0), 1e-12);
    EXPECT_NEAR(r.torque, 7 * std::acos(-1.0), 1e-10);
    EXPECT_EQ(open_loops(model).size(), 1U);
  }
}

/// Where a loop has no place of its own in body 2, it keeps the one that it starts with: a scene
/// with a joint elsewhere has the same loop, as its derivatives say.
TEST(Loops, KeepThePlaceThatTheyStartWith) {
  const Model model(parallelogram(0.02));
  ASSERT_TRUE(model.scene().loops[0].position2);
  EXPECT_NEAR((*model.scene().loops[0].position2)[2], -0.15, 1e-12);
  Scene moved = model.scene();
  moved.links[2].joint.pose.position[0] += 0.01;
  EXPECT_NEAR(loop_readings(Model(moved), Batch(Model(moved), 1), 0).at(0).gap, 0.01, 1e-9);
}

TEST(Loops, BalanceTheirEnergy) {
  Scene scene = parallelogram(0);
  scene.loops[0].stiffness = 1e4;
  scene.loops[0].damping = 30;
  const Model model(scene);
  const testing::EnergyLoss energy = testing::energy_loss(model);
  EXPECT_GT(energy.taken, 1e-7);
  EXPECT_NEAR(energy.lost, energy.taken, 2e-3 * energy.taken);
}

TEST(Loops, HaveTheSameBitsAloneAndInABatch) {
  Scene scene = testing::random_machine(4, 6);
  testing::close_loops(scene, 4, 3);
  scene.randomizations.push_back({{NumberOwner::loop, NumberField::stiffness, "loop0"},
                                  {Distribution::Kind::uniform, 100, 400, {}},
                                  {}});
  ASSERT_GE(scene.loops.size(), 2U);
  const Model model(scene);
  testing::expect_bits_of_lone_environments(model, 4);
}

/// Boxes on the ground, the first two held together by a weld: they sleep and wake as one.
TEST(Loops, JoinTreesThatSleep) {
  Scene s;
  s.integrator = Integrator::bdf1;
  s.ground = GroundDescription{};
  for (int k = 0; k < 6; ++k) {
    const std::string name = "box" + std::to_string(k);
    s.links.push_back(link(name, JointType::free, {0.06 * k, 0, 0.02},
                           CuboidShape{{0.04, 0.04, 0.04}, {3, 3, 3}}, 600));
    s.ground_contacts.push_back({name, {5e3, 5, 0.6, 100}, ContactLaw::clamped, 1e-5, {}});
  }
  LoopDescription d;
  d.name = "tie", d.weld = true;
  d.body1 = "box1", d.body2 = "box0";
  d.stiffness = 1e4, d.damping = 10;
  d.turning_stiffness = 10, d.turning_damping = 0.01;
  s.loops = {d};
  StepperOptions sleepy;
  sleepy.sleep = kUsualSleep;
  const Model model(s);
  Batch batch(model, 1), awake(model, 1);
  Stepper stepper(model, sleepy), plain(model);
  // Box 0 slides, so its partner stays awake; the others sleep.
  std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
  v[0] = 0.3;
  batch.set_state(0, q, v), awake.set_state(0, q, v);
  bool slept = false;
  for (int t = 0; t < 400; ++t) {
    stepper.step(batch, {});
    plain.step(awake, {});
    slept = slept || batch.sleep(0).bodies > 0;
    ASSERT_LT(loop_readings(model, batch, 0).at(0).gap, 1e-3);
  }
  EXPECT_TRUE(slept);
  EXPECT_EQ(batch.sleep(0).bodies, 6);
  for (std::size_t i = 0; i < q.size(); ++i)
    EXPECT_NEAR(testing::q_of(batch)[i], testing::q_of(awake)[i], 2e-4) << i;
}

class LoopsBySchemes : public ::testing::TestWithParam<Integrator> {};

TEST_P(LoopsBySchemes, GradientsMatchDifferencesAndTangents) {
  int compared = 0, runs = 0;
  for (unsigned seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Scene scene = testing::random_machine(seed, 3 + static_cast<int>(seed % 3));
    testing::close_loops(scene, seed, 2);
    if (scene.loops.empty() || testing::splits(scene, GetParam(), seed, 4)) continue;
    compared += testing::check_gradient(scene, GetParam(), seed, 4, 1e-6);
    const Model model(scene);
    runs += testing::check_tangent(model, testing::options(GetParam(), scene.timestep, 1e-13),
                                   testing::random_input(model, seed, 4), seed);
  }
  EXPECT_GT(compared, 80);
  EXPECT_GE(runs, 1);
}

INSTANTIATE_TEST_SUITE_P(Schemes, LoopsBySchemes,
                         ::testing::Values(Integrator::bdf1, Integrator::bdf2, Integrator::sdirk2,
                                           Integrator::sdirk3));

TEST(LoopFaults, SayWhatWasExpected) {
  const auto fault = [](const auto& change) {
    return testing::fault_of_model(parallelogram(0), change);
  };
  const auto has = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  has(fault([](Scene& s) { s.loops[0].body2 = "third"; }), "no body is named 'third'");
  has(fault([](Scene& s) { s.loops[0].body2 = "bar"; }), "with itself; expected two bodies");
  has(fault([](Scene& s) { s.loops[0].stiffness = 0; }), "stiffness=\"0\"; expected a positive");
  has(fault([](Scene& s) { s.loops[0].turning_damping = 1; }), "expected a weld");
  has(fault([](Scene& s) { s.loops.push_back(s.loops[0]); }),
      "already; expected a name of its own");
  has(fault([](Scene& s) {
        s.links[1].joint.type = JointType::fixed, s.initial.clear();
        s.loops[0].body2 = "left";
      }),
      "cannot move against each other");
  has(fault([](Scene& s) {
        s.randomizations.push_back({{NumberOwner::loop, NumberField::turning_stiffness, "pin"},
                                    {Distribution::Kind::uniform, 1, 2, {}},
                                    {}});
      }),
      "it is no weld");
}

}  // namespace
}  // namespace tangere
