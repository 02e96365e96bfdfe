// SPDX-License-Identifier: Apache-2.0
// Tests how much work Newton's search needs in scenes with many stiff contacts. Passes and splits
// are counts, equal on every machine.
#include <gtest/gtest.h>

#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

constexpr int kNewtonEnvironments = 64;

struct Effort {
  double passes = 0;  ///< evaluations of the residual per step and environment
  int splits = 0, failures = 0;
};

Effort run(const std::string& name) {
  const Model model(read_scene(std::string(TANGERE_SOURCE_DIR) + "/scenes/" + name + ".xml").scene);
  Batch batch(model, kNewtonEnvironments);
  Stepper stepper(model);
  const ControlProgram control(model, model.timestep(), 1);
  const std::size_t nu = std::size_t(model.nu());
  std::vector<double> u(kNewtonEnvironments * nu);
  Effort effort;
  for (std::int64_t k = 0; k < control.steps(); ++k) {
    for (int e = 0; e < kNewtonEnvironments; ++e)
      control.evaluate(k, e, std::span(u).subspan(std::size_t(e) * nu, nu));
    stepper.step(batch, u);
    for (int e = 0; e < kNewtonEnvironments; ++e) {
      effort.passes += batch.iterations(e);
      effort.splits += batch.status(e) == StepStatus::split ? 1 : 0;
    }
  }
  effort.failures = batch.failed_count();
  effort.passes /= double(kNewtonEnvironments) * double(control.steps());
  return effort;
}

// It takes 3.1 passes and no split. With the natural test alone it took 5.2 passes and 17 splits.
TEST(NewtonEffort, InsertionTouchesWithoutSplits) {
  const Effort e = run("insertion");
  EXPECT_EQ(e.failures, 0);
  EXPECT_LT(e.passes, 3.3);
  EXPECT_LE(e.splits, 2);
}

// Two of 11 520 steps split; without the secant of friction 19 did.
TEST(NewtonEffort, StableGraspSeldomSplits) {
  const Effort e = run("stable_grasp");
  EXPECT_EQ(e.failures, 0);
  EXPECT_LT(e.passes, 4.2);
  EXPECT_LE(e.splits, 10);
}

}  // namespace
}  // namespace tangere
