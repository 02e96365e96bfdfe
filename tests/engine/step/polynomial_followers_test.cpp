// SPDX-License-Identifier: Apache-2.0
// Tests a slider that follows a crank by a polynomial: against the equation of its one coordinate,
// its energy, bits in batches, and what is refused.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/engine/effect_properties.hpp"
#include "tests/engine/random_followers.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;

constexpr double kOffset = 0.05, kRatio = 0.1, kSquare = 0.2, kCube = -0.05, kFourth = 0.02;
constexpr double kInertia = 1.0 / 60, kMass = 0.5, kGravity = -9.81, kDamping = 0.3;

double place(double x) {
  return kOffset + kRatio * x + kSquare * x * x + kCube * std::pow(x, 3) + kFourth * std::pow(x, 4);
}
double slope(double x) {
  return kRatio + 2 * kSquare * x + 3 * kCube * x * x + 4 * kFourth * std::pow(x, 3);
}
double second(double x) { return 2 * kSquare + 6 * kCube * x + 12 * kFourth * x * x; }

/// A crank with the moment of inertia kInertia, and a mass on a rail against gravity.
Scene crank_and_slider() {
  Scene s;
  s.gravity = {kGravity, 0, 0};
  s.links = {
      link("crank", JointType::revolute, {}, CuboidShape{{0.1, 0.1, 0.02}, {2, 2, 2}}, 50000),
      link("slider", JointType::prismatic, {0, 1, 0}, CuboidShape{{0.1, 0.1, 0.1}, {2, 2, 2}},
           500)};
  s.links[0].joint.axis0 = {0, 0, 1};
  JointDescription& slider = s.links[1].joint;
  slider.axis0 = {1, 0, 0};
  slider.follows = {"crank_joint"};
  slider.ratio = {kRatio};
  slider.offset = kOffset;
  slider.powers = {kSquare, kCube, kFourth};
  slider.damping = kDamping;
  s.initial = {{"crank_joint", {0.3}, {1.0}, {}}};
  s.motors.push_back({"crank_joint", -1, 1, {}});
  return s;
}

/// (I + m p'²) x″ + m p' p″ ẋ² = τ + p' (m g - c p' ẋ), by Runge and Kutta in steps of 1e-5 s.
std::array<double, 2> crank_at(double time, double torque) {
  double q = 0.3, v = 1;
  const double h = 1e-5;
  const auto a = [&](double x, double rate) {
    const double p = slope(x);
    return (torque + p * (kMass * kGravity - kDamping * p * rate) -
            kMass * p * second(x) * rate * rate) /
           (kInertia + kMass * p * p);
  };
  for (int k = 0; k < static_cast<int>(std::lround(time / h)); ++k) {
    const double v1 = v, a1 = a(q, v1), v2 = v + h / 2 * a1, a2 = a(q + h / 2 * v1, v2),
                 v3 = v + h / 2 * a2, a3 = a(q + h / 2 * v2, v3), v4 = v + h * a3,
                 a4 = a(q + h * v3, v4);
    q += h / 6 * (v1 + 2 * v2 + 2 * v3 + v4);
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  return {q, v};
}

TEST(PolynomialFollowers, MoveByTheEquationOfOneCoordinateWithSecondOrder) {
  const Model model(crank_and_slider());
  EXPECT_NEAR(model.initial_q()[1], place(0.3), 1e-16);
  const auto [truth, rate] = crank_at(0.4, 0.05);
  EXPECT_GT(std::abs(truth - 0.3), 0.05) << "it moves";
  for (const Integrator scheme : {Integrator::bdf2, Integrator::sdirk2, Integrator::sdirk3}) {
    SCOPED_TRACE(to_string(scheme));
    const auto error = [&](double h) {
      Batch batch(model, 1);
      Stepper stepper(model, testing::options(scheme, h, 1e-13));
      for (int t = 0; t < static_cast<int>(std::lround(0.4 / h)); ++t) {
        stepper.step(batch, std::vector<double>{0.05});
        const std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
        EXPECT_NEAR(q[1], place(q[0]), 1e-14);
        EXPECT_NEAR(v[1], slope(q[0]) * v[0], 1e-14 * (1 + std::abs(v[1])));
      }
      return std::abs(testing::q_of(batch)[0] - truth);
    };
    const double coarse = error(2.5e-4), fine = error(1.25e-4);
    EXPECT_LT(fine, 1e-7);
    EXPECT_NEAR(std::log2(coarse / fine), 2, 0.15) << coarse << " " << fine;
  }
}

TEST(PolynomialFollowers, BalanceTheirEnergy) {
  Scene scene = crank_and_slider();
  scene.links[1].joint.stiffness = 40;
  scene.links[1].joint.armature = 0.1;
  const Model model(scene);
  const testing::EnergyLoss energy = testing::energy_loss(model);
  EXPECT_GT(energy.taken, 1e-3);
  EXPECT_NEAR(energy.lost, energy.taken, 1e-3 * energy.taken);
}

/// An environment has the same bits alone and among others, which are poisoned.
TEST(PolynomialFollowers, HaveTheSameBitsAloneAndAmongPoisonedOnes) {
  const Model model(testing::following_machine(5, 6, 1));
  ASSERT_GT(testing::count_polynomials(model.scene()), 0);
  const testing::RunInput in = testing::following_input(model, 5, 60);
  constexpr int kMany = 19;
  const auto run = [&](int count, int own, double poison) {
    Batch batch(model, count);
    Stepper stepper(model, testing::options(Integrator::sdirk2, 2e-3));
    for (int e = 0; e < count; ++e) {
      testing::RunInput other = in;
      if (e != own) other.v[0] = poison;
      batch.set_state(e, other.q, other.v);
    }
    for (const auto& u : in.u) testing::step_all(stepper, batch, u);
    EXPECT_FALSE(failed(batch.status(own)));
    return std::pair(testing::q_of(batch, own), testing::v_of(batch, own));
  };
  const auto alone = run(1, 0, 0);
  for (const int e : {0, 7, 18})
    for (const double poison : {0.3, 1e200, std::numeric_limits<double>::quiet_NaN()})
      EXPECT_EQ(run(kMany, e, poison), alone) << e << ", " << poison;
}

/// A slider of the slider's, and one of the crank's follower, are polynomials of the crank.
TEST(PolynomialFollowers, MayStandInAChainOfRatios) {
  Scene scene = crank_and_slider();
  LinkDescription gear = scene.links[0];  // turns 2 x - 0.1
  gear.name = gear.body.name = "gear";
  gear.joint.name = "gear_joint";
  gear.joint.follows = {"crank_joint"};
  gear.joint.ratio = {2};
  gear.joint.offset = -0.1;
  scene.links.push_back(gear);
  LinkDescription far = scene.links[1];  // by the polynomial of the gear
  far.name = far.body.name = "far";
  far.joint.name = "far_joint";
  far.joint.follows = {"gear_joint"};
  scene.links.push_back(far);
  LinkDescription mirror = far;  // -3 q of that, + 0.2
  mirror.name = mirror.body.name = "mirror";
  mirror.joint.name = "mirror_joint";
  mirror.joint.follows = {"far_joint"};
  mirror.joint.ratio = {-3};
  mirror.joint.offset = 0.2;
  mirror.joint.powers.clear();
  scene.links.push_back(mirror);
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(Integrator::bdf2, 1e-3));
  for (int t = 0; t < 50; ++t) stepper.step(batch, std::vector<double>{0.1});
  const std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
  EXPECT_GT(std::abs(q[0] - 0.3), 1e-3);
  EXPECT_NEAR(q[3], place(2 * q[0] - 0.1), 1e-13);
  EXPECT_NEAR(v[3], slope(2 * q[0] - 0.1) * 2 * v[0], 1e-13);
  EXPECT_NEAR(q[4], -3 * q[3] + 0.2, 1e-13);
  EXPECT_NEAR(v[4], -3 * v[3], 1e-13);
}

/// Powers of zero give the bits of a joint without powers.
TEST(PolynomialFollowers, WithoutPowersFollowByTheirRatio) {
  Scene scene = crank_and_slider();
  scene.links[1].joint.powers = {0, 0, 0};
  Scene plain = scene;
  plain.links[1].joint.powers.clear();
  const auto run = [](const Scene& s) {
    const Model model(s);
    Batch batch(model, 1);
    Stepper stepper(model, testing::options(Integrator::sdirk2, 1e-3));
    for (int t = 0; t < 20; ++t) stepper.step(batch, std::vector<double>{0.1});
    return testing::q_of(batch);
  };
  EXPECT_EQ(run(scene), run(plain));
}

TEST(PolynomialFollowerFaults, NameBothJoints) {
  const auto fault = [](const auto& change) {
    Scene s = crank_and_slider();
    LinkDescription third = s.links[1];
    third.name = third.body.name = "third";
    third.joint.name = "third_joint";
    s.links.push_back(third);
    change(s.links[2].joint);
    try {
      const Model model(s);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const auto has = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  has(fault([](JointDescription& d) { d.follows = {"slider_joint"}; }),
      "joint 'third_joint' follows 'slider_joint' by a polynomial, and 'slider_joint' follows by "
      "one itself");
  has(fault([](JointDescription& d) {
        d.follows = {"crank_joint", "slider_joint"};
        d.ratio = {1, 1};
        d.powers.clear();
      }),
      "joint 'third_joint' follows 2 joints, of which 'slider_joint' follows by a polynomial");
  has(fault([](JointDescription& d) {
        d.follows = {"crank_joint", "slider_joint"};
        d.ratio = {1, 1};
      }),
      "has powers and follows 2 joints; expected one");
  has(fault([](JointDescription& d) {
        d.powers = {1, 1, 1, 1};
      }),
      "has 4 powers; expected at most 3");
  Scene start = crank_and_slider();
  start.initial.push_back({"slider_joint", {0.4}, {}, {}});
  try {
    const Model model(start);
    ADD_FAILURE() << "it starts elsewhere";
  } catch (const InputError& e) {
    has(e.what(), "expected no start of its own");
  }
  Batch batch(Model(crank_and_slider()), 1);
  EXPECT_THROW(batch.set_state(0, std::vector<double>{0.1, 0}, std::vector<double>{0, 0}),
               InputError);
}

}  // namespace
}  // namespace tangere
