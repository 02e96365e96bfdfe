// SPDX-License-Identifier: Apache-2.0
// Tests steps that are hard to solve: where a shortest part has no root, another scheme takes it,
// and gradients follow the parts as they were taken.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/derivative/adjoint.hpp"
#include "engine/derivative/tangent.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/engine/runs.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

constexpr int kThrowSteps = 25;
// Of these sixteen boxes, drawn with seed 0, one meets the ground so that BDF1 finds no root in
// parts of h/256.
constexpr int kHardBlock = 31, kHardLane = 11;

/// Light boxes that are thrown at ground with ten thousand times the friction of the scene's file.
Model thrown_boxes() {
  constexpr double kRougher = 1e4;
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/hard/hard_batch.xml").scene;
  scene.timestep = 0.02;
  scene.solver.bounded_energy = false;  // no other reason to change the scheme
  for (auto& contact : scene.ground_contacts) contact.coefficients.kt *= kRougher;
  for (RandomizationDescription& drawn : scene.randomizations) {
    if (drawn.number.field != NumberField::kt) continue;
    drawn.distribution.a *= kRougher;
    drawn.distribution.b *= kRougher;
  }
  return Model(scene);
}

class HardSplit : public ::testing::Test {
 protected:
  HardSplit() {
    tape.start(batch, kHardBlock);
    for (int t = 0; t < kThrowSteps; ++t) stepper.step_block(batch, kHardBlock, {}, &tape);
  }
  const Model model = thrown_boxes();
  Stepper stepper{model, testing::options(Integrator::bdf1, model.timestep(), 1e-9)};
  Batch batch{model, (kHardBlock + 1) * kernels::kBlock};
  BlockTape tape{model, Integrator::bdf1, kThrowSteps};
};

TEST_F(HardSplit, APartWithoutARootIsTakenByAnotherScheme) {
  int taken = 0;
  for (int t = 0; t < kThrowSteps; ++t) {
    const TapedStep* const step = tape.special(t, kHardLane);
    if (step == nullptr) continue;
    double whole = 0;
    for (const TapedSolve& part : step->solves) {
      whole += part.h;
      if (part.integrator == Integrator::bdf1) continue;
      EXPECT_EQ(part.integrator, Integrator::sdirk2);
      EXPECT_DOUBLE_EQ(part.h, model.timestep() / 256);
      ++taken;
    }
    EXPECT_NEAR(whole, model.timestep(), 1e-12);
  }
  EXPECT_GT(taken, 0);
  for (int l = 0; l < kernels::kBlock; ++l)
    EXPECT_FALSE(failed(batch.status(kHardBlock * kernels::kBlock + l))) << l;
}

TEST_F(HardSplit, GradientsFollowThePartsAsTaken) {
  testing::Random random(3);
  const auto nv = static_cast<std::size_t>(model.nv());
  const auto draw = [&] {
    std::vector<double> x(nv);
    for (double& a : x) a = random.normal();
    return x;
  };
  const StepperOptions options = testing::options(Integrator::bdf1, model.timestep(), 1e-9);
  const std::vector<double> q = draw(), v = draw(), q_bar = draw(), v_bar = draw();
  StateTangent state{q, v, std::vector<double>(nv), std::vector<double>(nv)};
  Tangent tangent(model, options);
  for (int t = 0; t < kThrowSteps; ++t)
    tangent.step(batch, kHardBlock, kHardLane, tape, t, {}, {}, {}, state);
  Adjoint adjoint(model, options);
  adjoint.clear();
  BlockCotangent& bar = adjoint.loss(0);
  const auto at = [](std::size_t i) { return i * kernels::kBlock + kHardLane; };
  for (std::size_t i = 0; i < nv; ++i) bar.q[at(i)] = q_bar[i], bar.v[at(i)] = v_bar[i];
  for (int t = kThrowSteps; t-- > 0;) adjoint.reverse_step(batch, kHardBlock, tape, t, {});
  double forward = 0, backward = 0, size = 0;
  for (std::size_t i = 0; i < nv; ++i) {
    forward += q_bar[i] * state.q[i] + v_bar[i] * state.v[i];
    backward += bar.q[at(i)] * q[i] + bar.v[at(i)] * v[i];
    size += std::abs(q_bar[i] * state.q[i]) + std::abs(v_bar[i] * state.v[i]);
  }
  EXPECT_GT(size, 0);
  EXPECT_NEAR(forward, backward, 1e-9 * size);
}

}  // namespace
}  // namespace tangere
