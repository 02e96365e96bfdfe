// SPDX-License-Identifier: Apache-2.0
// Tests gradients of whole batches: the same bits however they are computed, and correct on every
// shipped scene.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/step/control.hpp"
#include "engine/step/tape.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/gradients/gradient_check.hpp"
#include "tasks/gradients/losses.hpp"

namespace tangere {
namespace {

Scene shipped(const std::string& name) {
  return read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene;
}

StepControls controls_of(const ControlProgram& program) {
  return [&program](std::int64_t step, int environment, std::span<double> u) {
    program.evaluate(step, environment, u);
  };
}

GradientSummary gradients(const Model& model, int environments, std::int64_t steps, int threads,
                          double tape_bytes, int losses = 2) {
  const Batch start(model, environments, 5);
  const ControlProgram program(model, model.timestep(), 5);
  const auto shear = make_loss(LossKind::shear, model, 5),
             final_state = make_loss(LossKind::final_state, model, 5);
  const RolloutLoss* const both[] = {shear.get(), final_state.get()};
  TapeOptions options;
  options.length = steps;
  options.threads = threads;
  options.parameters = options.points = true;
  options.tape_bytes = tape_bytes;
  return rollout_gradients(start, controls_of(program), options,
                           std::span(both).first(std::size_t(losses)));
}

void expect_same(const GradientSummary& a, const GradientSummary& b, std::size_t losses = 2) {
  for (std::size_t k = 0; k < losses; ++k) {
    EXPECT_EQ(a.losses[k].value, b.losses[k].value);
    EXPECT_EQ(a.losses[k].u, b.losses[k].u);
    EXPECT_EQ(a.losses[k].q, b.losses[k].q);
    EXPECT_EQ(a.losses[k].v, b.losses[k].v);
    EXPECT_EQ(a.losses[k].parameters, b.losses[k].parameters);
    EXPECT_EQ(a.losses[k].points, b.losses[k].points);
  }
}

TEST(Gradients, ThreadsChangeNothing) {
  const Model model(shipped("rolling_ball_small"));
  expect_same(gradients(model, 40, 110, 1, 1e9), gradients(model, 40, 110, 3, 1e9));
}

TEST(Gradients, CheckpointsChangeNothing) {
  for (const Integrator scheme : {Integrator::bdf2, Integrator::sdirk2}) {
    Scene scene = shipped("rolling_ball_small");
    scene.integrator = scheme;
    const Model model(scene);
    const GradientSummary stored = gradients(model, 20, 110, 1, 1e9),
                          again = gradients(model, 20, 110, 1, 1.5e5);
    EXPECT_EQ(stored.recomputed_steps, 0);
    EXPECT_GE(again.recomputed_steps, 2 * 110);
    expect_same(stored, again);
  }
}

TEST(Gradients, AnotherLossBesideChangesNothing) {
  const Model model(shipped("box_pushing"));
  const GradientSummary one = gradients(model, 3, 60, 1, 1e9, 1),
                        two = gradients(model, 3, 60, 1, 1e9, 2);
  expect_same(one, two, 1);
  EXPECT_NE(two.losses[0].u, two.losses[1].u);
}

TEST(Gradients, TapesThatAreTooSmallAreRefused) {
  const Model model(shipped("rolling_ball_small"));
  EXPECT_THROW(gradients(model, 1, 110, 1, 1e4), InputError);
  EXPECT_THROW(gradients(model, 1, 0, 1, 1e9), InputError);
  EXPECT_THROW(gradients(model, 1, 10, 0, 1e9), InputError);
}

/// Again and again with batches of any size; not with another model's.
/// By points: a result of each environment, and the sums of sixteen on every thread.
TEST(Gradients, MemoryOfPointsIsCounted) {
  const Model model(shipped("rolling_ball_small"));
  TapeOptions options;
  options.length = 10;
  options.threads = 3;
  const double without = gradient_bytes(model, 40, options, 2);
  options.points = true;
  const double numbers = double(tactile_points(model)) * kPointNumbers;
  EXPECT_DOUBLE_EQ(gradient_bytes(model, 40, options, 2) - without,
                   8 * numbers * 2 * (40 + 3 * 16));
}

TEST(Gradients, RolloutsCanBeUsedAgain) {
  const Model model(shipped("rolling_ball_small"));
  const ControlProgram program(model, model.timestep(), 5);
  const auto loss = make_loss(LossKind::shear, model, 5);
  const RolloutLoss* const losses[] = {loss.get()};
  TapeOptions options;
  options.length = 80;
  GradientRollouts rollouts(model, options, losses);
  const GradientSummary large = rollouts.run(Batch(model, 18, 5), controls_of(program));
  const GradientSummary small = rollouts.run(Batch(model, 2, 5), controls_of(program));
  const auto per = small.losses[0].u.size() / 2;
  for (std::size_t i = 0; i < 2 * per; ++i) EXPECT_EQ(small.losses[0].u[i], large.losses[0].u[i]);
  EXPECT_THROW(rollouts.run(Batch(Model(shipped("box_pushing")), 2), controls_of(program)),
               InputError);
}

/// An environment that fails is named, has finite derivatives and leaves its neighbours alone.
TEST(Gradients, AFailureDisturbsNobody) {
  const Model model(shipped("rolling_ball_small"));
  const Batch start(model, 3, 5);
  const ControlProgram program(model, model.timestep(), 5);
  const auto loss = make_loss(LossKind::final_state, model, 5);
  const RolloutLoss* const losses[] = {loss.get()};
  TapeOptions options;
  options.length = 30;
  const auto broken = [&](std::int64_t step, int e, std::span<double> u) {
    program.evaluate(step, e, u);
    if (e == 1 && step == 12) u[0] = NAN;
  };
  const GradientSummary whole = rollout_gradients(start, controls_of(program), options, losses);
  const GradientSummary hurt = rollout_gradients(start, broken, options, losses);
  ASSERT_EQ(hurt.failures.size(), 1U);
  EXPECT_EQ(hurt.failures[0].environment, 1);
  EXPECT_EQ(hurt.failures[0].step, 12);
  const auto per = whole.losses[0].u.size() / 3;
  for (std::size_t e = 0; e < 3; ++e)
    for (std::size_t i = e * per; i < (e + 1) * per; ++i) {
      EXPECT_TRUE(std::isfinite(hurt.losses[0].u[i]));
      EXPECT_TRUE(e == 1 || hurt.losses[0].u[i] == whole.losses[0].u[i]);
    }
}

/// A rollout that asks for gradients takes the same steps as one that does not.
TEST(Gradients, ForwardBitsAreThoseOfAPlainRollout) {
  const Model model(shipped("rolling_ball_small"));
  Batch plain(model, 18, 5), taped(model, 18, 5);
  Stepper stepper(model);
  const ControlProgram program(model, model.timestep(), 5);
  BlockTape tape(model, model.integrator(), 110);
  tape.start(taped, 0);
  std::vector<double> u(18 * std::size_t(model.nu()));
  for (std::int64_t t = 0; t < 110; ++t) {
    const auto nu = std::size_t(model.nu());
    for (std::size_t e = 0; e < 18; ++e)
      program.evaluate(t, std::int64_t(e), std::span(u).subspan(e * nu, nu));
    stepper.step_block(plain, 0, u);
    stepper.step_block(taped, 0, u, &tape);
  }
  std::vector<double> a(std::size_t(model.nq())), b(a);
  for (int e = 0; e < 16; ++e) {
    plain.get_q(e, a);
    taped.get_q(e, b);
    EXPECT_EQ(a, b);
  }
}

struct Checked {
  const char* scene;
  LossKind loss;
  std::int64_t steps;
};
void PrintTo(const Checked& c, std::ostream* out) {
  *out << c.scene << " " << to_string(c.loss) << " " << c.steps;
}

class ShippedScene : public ::testing::TestWithParam<Checked> {};

/// Fields under BDF2, a rolling ball, motors that hold positions: cases in which other programs'
/// derivatives are zero or wrong.
TEST_P(ShippedScene, GradientsAgreeByThreeRoutes) {
  const auto [name, kind, steps] = GetParam();
  const Model model(shipped(name));
  const Batch start(model, 1, 3);
  const ControlProgram program(model, model.timestep(), 3);
  const auto loss = make_loss(kind, model, 5);
  CheckOptions options;
  options.length = steps;
  options.entries = 4;
  options.stepper.tolerance = 1e-12;
  const GradientCheck check = check_gradient(start, controls_of(program), *loss, options);
  for (const CheckedInput& c : check.inputs) {
    EXPECT_GT(c.norm, 0) << c.name;
    EXPECT_LE(c.tangent_error, 1e-10) << c.name;
    EXPECT_LE(c.difference_error, steps > 100 ? 1e-5 : 5e-6) << c.name << " at " << c.worst;
  }
  EXPECT_GT(check.entries(), 2 * check.kinks());
}

INSTANTIATE_TEST_SUITE_P(Scenes, ShippedScene,
                         ::testing::Values(Checked{"rolling_ball_small", LossKind::tactile, 100},
                                           Checked{"rolling_ball_small", LossKind::shear, 350},
                                           Checked{"rolling_ball_small", LossKind::final_state, 20},
                                           Checked{"box_pushing", LossKind::tactile, 100},
                                           Checked{"box_pushing", LossKind::end_effectors, 100},
                                           Checked{"stable_grasp", LossKind::path, 20},
                                           Checked{"stable_grasp", LossKind::tactile, 60},
                                           Checked{"cap_opening", LossKind::final_state, 100},
                                           Checked{"insertion", LossKind::shear, 45}));

}  // namespace
}  // namespace tangere
