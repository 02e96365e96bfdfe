// SPDX-License-Identifier: Apache-2.0
// Tests which tolerance is in force: the caller's, the scene's, or the one that follows the step.
#include "engine/step/step_settings.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

double in_force(const Scene& scene, const StepperOptions& options = {}) {
  return Stepper(Model(scene), options).tolerance();
}

TEST(StepTolerance, FollowsSchemeAndStep) {
  const Model model(testing::rolling_ball(false, 4));
  const auto at = [&](Integrator integrator, double h) {
    return model.following_tolerance(integrator, h);
  };
  EXPECT_NEAR(at(Integrator::bdf1, 2e-3) / at(Integrator::bdf1, 1e-3), 4, 1e-9);
  for (const Integrator high : {Integrator::bdf2, Integrator::sdirk2, Integrator::sdirk3})
    EXPECT_NEAR(at(high, 4e-3) / at(high, 2e-3), 8, 1e-9);
  EXPECT_EQ(at(Integrator::bdf1, 1), 1e-4) << "no looser than this";
  EXPECT_EQ(at(Integrator::sdirk2, 1e-6), 1e-9) << "no tighter";
}

TEST(StepTolerance, MeansTheSameUnderAnyGravity) {
  Scene small = testing::rolling_ball(false, 4), slow = small;
  for (double& g : slow.gravity) g /= 100;  // falls take ten times as long
  const double h = 2e-3;
  EXPECT_NEAR(Model(slow).following_tolerance(Integrator::sdirk2, 10 * h) /
                  Model(small).following_tolerance(Integrator::sdirk2, h),
              1, 1e-9);
  slow.gravity = {0, 0, 0};
  EXPECT_EQ(Model(slow).following_tolerance(Integrator::sdirk2, h), 1e-9);
}

/// A hundredth of the accuracy, but not much looser than plain steps.
TEST(StepTolerance, FollowsTheAccuracyAndTheStep) {
  const Scene scene = testing::rolling_ball(false, 4);
  const auto at = [&](double h, double accuracy) {
    return in_force(scene, {Integrator::sdirk2, h, std::nullopt, accuracy});
  };
  EXPECT_DOUBLE_EQ(at(2e-2, 1e-4), 1e-6);
  EXPECT_DOUBLE_EQ(at(1e-3, 1e-2), 10 * Model(scene).following_tolerance(Integrator::sdirk2, 1e-3));
}

TEST(StepTolerance, IsTheCallersThenTheScenes) {
  Scene scene = testing::rolling_ball(false, 4);
  EXPECT_EQ(in_force(scene), Model(scene).following_tolerance(scene.integrator, scene.timestep));
  EXPECT_EQ(in_force(scene, {.integrator = Integrator::sdirk3, .timestep = 1e-2, .tolerance = {}}),
            Model(scene).following_tolerance(Integrator::sdirk3, 1e-2));
  EXPECT_EQ(in_force(scene, {.differentiable = true}), kGradientTolerance);
  scene.solver.tolerance = 1e-7;
  EXPECT_EQ(in_force(scene), 1e-7);
  EXPECT_EQ(in_force(scene, {.differentiable = true}), 1e-7);
  EXPECT_EQ(in_force(scene, {.integrator = {}, .timestep = {}, .tolerance = 1e-6}), 1e-6);
}

/// Solves whose tolerance follows the step end where their contraction promises it; a tolerance
/// that somebody named is checked. Both are as near to the root.
TEST(StepTolerance, ChecksWhatWasNamed) {
  const Model model(testing::rolling_ball(false, 4));
  struct Solved {
    std::vector<double> q;
    int evaluations = 0;
    double residual = 0;  // largest
  };
  const auto play = [&](const StepperOptions& options) {
    Stepper stepper(model, options);
    Batch batch(model, 1);
    Solved run;
    for (int k = 0; k < 350; ++k) {
      testing::step_all(stepper, batch, testing::rolling_ball_control(k));
      run.evaluations += batch.iterations(0);
      run.residual = std::max(run.residual, batch.residual(0));
    }
    run.q = testing::q_of(batch);
    return run;
  };
  for (const Integrator integrator : {Integrator::bdf2, Integrator::sdirk2}) {
    const double tolerance = model.following_tolerance(integrator, model.timestep());
    const Solved spared = play({.integrator = integrator, .timestep = {}, .tolerance = {}});
    const Solved checked = play({.integrator = integrator, .timestep = {}, .tolerance = tolerance});
    const Solved exact = play({.integrator = integrator, .timestep = {}, .tolerance = 1e-12});
    EXPECT_LT(spared.evaluations, checked.evaluations) << to_string(integrator);
    EXPECT_LE(spared.residual, tolerance) << to_string(integrator);
    for (const std::size_t i : {3, 4})  // the ball's place [m]
      EXPECT_NEAR(spared.q[i], exact.q[i], 1e-7) << to_string(integrator);
  }
}

}  // namespace
}  // namespace tangere
