// SPDX-License-Identifier: Apache-2.0
// Tests that lengths and times far below those of a robot's change nothing: steps of nanoseconds
// and balls of a micrometre.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "engine/model/model.hpp"
#include "engine/model/short_touches.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

/// The rounding of a ball's position hides no weight. One body is solved by the norm of the whole
/// scene, two by norms of their own.
TEST(SmallScales, StepsOfNanosecondsFall) {
  for (const int bodies : {1, 2})
    for (const Integrator scheme : integrators())
      for (const double h : {1e-6, 1e-8, 1e-10, 1e-12}) {
        Scene s;
        for (int k = 0; k < bodies; ++k)
          s.links.push_back(link("ball" + std::to_string(k), JointType::free, {1.0 + k, 0, 1},
                                 SphereShape{0.05}, 1000));
        const Model model(s);
        Batch batch(model, 1);
        Stepper stepper(model, testing::options(scheme, h, 1e-9));
        for (int t = 0; t < 50; ++t) stepper.step(batch, {});
        const double fallen = -9.8 * 50 * h;
        for (int k = 0; k < bodies; ++k)
          EXPECT_NEAR(v_of(batch)[std::size_t(6 * k + 2)], fallen, 1e-6 * std::abs(fallen))
              << to_string(scheme) << " " << h << " s, body " << k;
      }
}

/// A ball falls from a tenth of its radius and comes to rest a thousandth of it deep, whatever the
/// radius. In multiples of the radius and of the period, all of them move alike.
TEST(SmallScales, BallsOfAnySizeComeToRest) {
  for (const double radius : {1e-6, 1e-4, 1e-2}) {
    Scene s;
    s.ground = GroundDescription{};
    s.links = {link("ball", JointType::free, {0, 0, 1.1 * radius}, SphereShape{radius}, 1000)};
    const double mass = 1000 * 4.0 / 3 * std::numbers::pi * std::pow(radius, 3),
                 depth = 1e-3 * radius, kn = mass * 9.8 / depth,
                 h = 2 * std::numbers::pi * std::sqrt(mass / kn) / 40;
    s.ground_contacts.push_back(
        {"ball", {kn, 0, 0, 0.4 * std::sqrt(kn * mass)}, ContactLaw::linear, {}, {}});
    const Model model(s);
    Batch batch(model, 1);
    Stepper stepper(model, testing::options(Integrator::sdirk2, h, 1e-10));
    for (int t = 0; t < 4000; ++t) stepper.step(batch, {});
    EXPECT_LT(std::abs(v_of(batch)[2]), 1e-6 * std::sqrt(9.8 * radius)) << radius << " m";
    EXPECT_NEAR(q_of(batch)[2] + 0.1 * radius, -depth, 1e-4 * depth) << radius << " m";
  }
}

/// Damping that takes hardly anything is none: the line stays, and says how much it takes. With a
/// fifth of the critical damping a touch takes 1 - exp(-π/5) of the speed, and the line goes.
TEST(SmallScales, DampingThatTakesNothingIsNone) {
  const auto lines = [](ContactLaw law, double damping) {
    Scene s;
    s.ground = GroundDescription{};
    s.links = {link("ball", JointType::free, {0, 0, 0.05}, SphereShape{0.01}, 2387.3241)};
    s.ground_contacts.push_back({"ball", {1e4, 1, 0.5, damping}, law, {}, {}});
    return short_touches(Model(s), Integrator::sdirk2, 5e-3);
  };
  for (const ContactLaw law : {ContactLaw::linear, ContactLaw::clamped}) {
    ASSERT_EQ(lines(law, 0).size(), 1U);
    EXPECT_NE(lines(law, 0)[0].find("has no damping"), std::string::npos);
    ASSERT_EQ(lines(law, 1e-9).size(), 1U);
    EXPECT_NE(lines(law, 1e-9)[0].find("has a damping that takes"), std::string::npos)
        << lines(law, 1e-9)[0];
  }
  EXPECT_TRUE(lines(ContactLaw::linear, 0.4 * std::sqrt(1e4 * 0.01)).empty());
  // Of a damping that varies, the largest counts.
  for (const double most : {1e-9, 1e4}) {
    Scene s;
    s.ground = GroundDescription{};
    s.links = {link("ball", JointType::free, {0, 0, 0.05}, SphereShape{0.01}, 2387.3241)};
    s.ground_contacts.push_back({"ball", {1e4, 1, 0.5, 0}, ContactLaw::clamped, {}, {}});
    s.randomizations.push_back({{NumberOwner::ground, NumberField::damping, "ball"},
                                {Distribution::Kind::uniform, 0, most, {}},
                                {}});
    EXPECT_EQ(short_touches(Model(s), Integrator::sdirk2, 5e-3).size(), most < 1 ? 1U : 0U) << most;
  }
  EXPECT_TRUE(lines(ContactLaw::clamped, 1e4).empty());
}

}  // namespace
}  // namespace tangere
