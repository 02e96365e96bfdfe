// SPDX-License-Identifier: Apache-2.0
// Tests that bodies which turn far in a step keep their momentum, and that others are left alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/vector3.hpp"
#include "engine/model/compiled_model.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::q_of;
using testing::v_of;

constexpr Vector3 kEdges{0.06, 0.04, 0.02};
const std::vector<double> kTumbling{0, 0, 0, 0.5, 100, 0.5};  // about the middle axis

/// A box that flies freely. `aside`: of its centre in its joint's frame.
Scene flying(const Vector3& aside = {0, 0, 0}) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("box", JointType::free, {0, 0, 0}, CuboidShape{kEdges}, 1000)};
  s.links[0].body.pose.position = aside;
  return s;
}

/// Momentum about the box's centre, world axes, over its density's unit; and energy of turning.
struct Turning {
  kernels::Vec3<double> momentum;
  double energy;
};
Turning turning_of(const std::vector<double>& q, const std::vector<double>& v) {
  const double a = kEdges[0] * kEdges[0], b = kEdges[1] * kEdges[1], c = kEdges[2] * kEdges[2];
  const kernels::Vec3<double> w = {v[3], v[4], v[5]},
                              P = {(b + c) * w.x, (a + c) * w.y, (a + b) * w.z};
  return {to_matrix(kernels::Quat<double>{q[3], q[4], q[5], q[6]}) * P, dot(w, P) / 2};
}

/// What a run for 0.3 s comes to: the largest changes, as shares, and how many steps were split.
struct Flight {
  double momentum = 0, energy = 0;
  int split = 0;
};
Flight fly(const Scene& scene, const StepperOptions& options) {
  const Model model(scene);
  Batch batch(model, 1);
  batch.set_state(0, q_of(batch), kTumbling);
  Stepper stepper(model, options);
  const Turning start = turning_of(q_of(batch), v_of(batch));
  Flight flight;
  for (int t = 0; t * stepper.timestep() < 0.3; ++t) {
    stepper.step(batch, {});
    // Damped: an arm of 60 mm that turns by 0.5 rad makes energy, too.
    EXPECT_TRUE(batch.status(0) == StepStatus::converged || batch.status(0) == StepStatus::split ||
                batch.status(0) == StepStatus::damped)
        << to_string(batch.status(0));
    flight.split += batch.status(0) == StepStatus::split;
    const Turning now = turning_of(q_of(batch), v_of(batch));
    const auto change = now.momentum - start.momentum;
    flight.momentum = std::max(
        flight.momentum, std::sqrt(dot(change, change) / dot(start.momentum, start.momentum)));
    flight.energy = std::max(flight.energy, std::abs(now.energy / start.energy - 1));
  }
  return flight;
}

TEST(TurningBodies, KeepMomentumAndEnergy) {
  for (const Integrator scheme : integrators())
    for (const double h : {1e-3, 5e-3})
      for (const Vector3& aside : {Vector3{0, 0, 0}, Vector3{0.05, -0.03, 0.02}}) {
        SCOPED_TRACE(std::string(to_string(scheme)) + " " + std::to_string(h) + " s, " +
                     std::to_string(aside[0]) + " m aside");
        const Flight flight = fly(flying(aside), testing::options(scheme, h));
        const double share = aside[0] == 0 ? 1e-3 : 1e-2;
        EXPECT_LE(flight.momentum, share);
        EXPECT_LE(flight.energy, share);
        if (scheme == Integrator::bdf1) {
          EXPECT_GT(flight.split, 0);
        }
      }
}

TEST(TurningBodies, AreLeftToTheSchemeWhereTheSceneSaysSo) {
  Scene scene = flying();
  scene.solver.bounded_energy = false;
  const Flight flight = fly(scene, testing::options(Integrator::bdf1, 5e-3));
  EXPECT_GT(flight.momentum, 0.1);
  EXPECT_EQ(flight.split, 0);
}

/// The estimate of an accuracy sees the displacement alone.
TEST(TurningBodies, KeepMomentumWithAnAccuracyToo) {
  StepperOptions options = testing::options(Integrator::sdirk2, 5e-3);
  options.accuracy = 0.1;
  EXPECT_LE(fly(flying(), options).momentum, 1e-3);
}

/// An axis that stays is turned about exactly, however fast. So is a ball's.
TEST(TurningBodies, AreLeftAloneWhereTheirAxisStays) {
  for (const Integrator scheme : integrators())
    for (const bool ball : {false, true}) {
      std::vector<std::vector<double>> ends;
      for (const bool bounded : {true, false}) {
        Scene scene = flying();
        if (ball) scene.links[0].body.shape = SphereShape{0.02};
        scene.solver.bounded_energy = bounded;
        const Model model(scene);
        Batch batch(model, 1);
        batch.set_state(0, q_of(batch),
                        ball ? std::vector<double>{1, 0, 0, 60, -50, 40}
                             : std::vector<double>{0, 0, 1, 0, 0, 100});
        Stepper stepper(model, testing::options(scheme, 5e-3, 1e-13));
        for (int t = 0; t < 20; ++t) {
          stepper.step(batch, {});
          EXPECT_EQ(batch.status(0), StepStatus::converged) << to_string(scheme) << ball;
        }
        ends.push_back(q_of(batch));
      }
      EXPECT_EQ(ends[0], ends[1]) << to_string(scheme);
    }
}

/// Environments of a group turn at different rates. Each has the bits that it has alone.
TEST(TurningBodies, BitsDoNotDependOnCompany) {
  const Scene scene = flying({0.01, 0, 0});
  for (const Integrator scheme : integrators()) {
    const auto play = [&](int environments, int first) {
      const Model model(scene);
      Batch batch(model, environments);
      for (int e = 0; e < environments; ++e)
        batch.set_state(e, q_of(batch, e), std::vector<double>{0, 0, 0, 1, 14.0 * (first + e), 2});
      Stepper stepper(model, testing::options(scheme, 5e-3));
      int split = 0;
      std::vector<std::vector<double>> ends;
      for (int t = 0; t < 10; ++t) {
        stepper.step(batch, {});
        for (int e = 0; e < environments; ++e) split += batch.status(e) == StepStatus::split;
      }
      for (int e = 0; e < environments; ++e) ends.push_back(v_of(batch, e));
      return std::pair{ends, split};
    };
    const auto [together, split] = play(11, 0);
    EXPECT_GT(split, 10) << to_string(scheme);
    EXPECT_LT(split, 110) << to_string(scheme);
    for (int e = 0; e < 11; ++e) EXPECT_EQ(together[std::size_t(e)], play(1, e).first[0]) << e;
  }
}

TEST(TurningBodies, GradientsGoThroughTheirParts) {
  for (const Integrator scheme : integrators()) {
    SCOPED_TRACE(to_string(scheme));
    testing::expect_gradient_through(Model(flying({0.01, 0, 0})),
                                     testing::options(scheme, 5e-3, 1e-13),
                                     {0.2, 0.1, -1, 5, 90, 7}, StepStatus::split);
  }
}

}  // namespace
}  // namespace tangere
