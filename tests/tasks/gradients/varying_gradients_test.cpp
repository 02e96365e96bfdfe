// SPDX-License-Identifier: Apache-2.0
// Tests gradients if sizes and places vary by environment: each environment has those of its own
// numbers, by three routes.
#include <gtest/gtest.h>

#include <optional>
#include <tuple>

#include "engine/derivative/number_gradients.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/step/control.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/gradients/gradient_check.hpp"
#include "tasks/gradients/losses.hpp"

namespace tangere {
namespace {

/// A scene with additional varying numbers. They come last, so that the others are drawn as without
/// them.
Scene varied(const std::string& name, const std::string& lines) {
  const std::string path = TANGERE_SOURCE_DIR "/scenes/" + name + ".xml";
  const std::string text = read_scene(path).scene.text;
  const std::size_t at = text.find("</randomize>");
  return parse_scene(text.substr(0, at) + lines + text.substr(at), path).scene;
}

StepControls controls_of(const ControlProgram& program) {
  return
      [&program](std::int64_t step, int e, std::span<double> u) { program.evaluate(step, e, u); };
}

struct Case {
  const char *name, *lines;
  LossKind loss;
  int steps;
  std::optional<Integrator> integrator = std::nullopt;  ///< in place of the scene's
};

class VaryingNumbers : public ::testing::TestWithParam<Case> {};

TEST_P(VaryingNumbers, AgreeByThreeRoutes) {
  const Case c = GetParam();
  Scene scene = varied(c.name, c.lines);
  scene.integrator = c.integrator.value_or(scene.integrator);
  const Model model(scene);
  const Batch start(model, 1, 3);
  const ControlProgram program(model, model.timestep(), 3);
  const auto loss = make_loss(c.loss, model, 5);
  CheckOptions options;
  options.length = c.steps;
  options.entries = 8;
  options.stepper.tolerance = 1e-12;
  const GradientCheck check = check_gradient(start, controls_of(program), *loss, options);
  for (const CheckedInput& i : check.inputs) {
    EXPECT_GT(i.norm, 0) << i.name;
    EXPECT_LE(i.tangent_error, 1e-10) << i.name;
    EXPECT_LE(i.difference_error, 5e-6) << i.name << " at " << i.worst;
  }
  EXPECT_GT(check.entries(), 2 * check.kinks());
}

constexpr const char* kCap = R"(<body name="cap" field="radius" uniform="0.038 0.044"/>
<joint name="cap" pos="0" uniform="-0.003 0.003"/><joint name="cap" pos="1" uniform="-0.003 0.003"/>
<body name="cap" field="density" uniform="400 800"/>)";
constexpr const char* kBall = R"(<body name="ball" field="radius" uniform="0.019 0.0203"/>)";
INSTANTIATE_TEST_SUITE_P(
    Scenes, VaryingNumbers,
    ::testing::Values(Case{"cap_opening", kCap, LossKind::final_state, 100},
                      Case{"cap_opening", kCap, LossKind::tactile, 100},
                      Case{"cap_opening", kCap, LossKind::tactile, 80, Integrator::sdirk3},
                      Case{"cap_opening", kCap, LossKind::end_effectors, 80, Integrator::sdirk2},
                      Case{"rolling_ball_small", kBall, LossKind::tactile, 100},
                      Case{"rolling_ball_small", kBall, LossKind::shear, 120}));

/// The scene with the numbers of one environment in place of its last `count`.
Scene written(Scene scene, const Batch& batch, int environment, std::size_t count) {
  for (; count > 0; --count) {
    const RandomizationDescription d = scene.randomizations.back();
    scene.randomizations.pop_back();
    const double value =
        batch.randomized_value(environment, static_cast<int>(scene.randomizations.size()));
    number_in(scene, d.number) = value;
  }
  return scene;
}

std::vector<double> part(const std::vector<double>& x, std::size_t i, std::size_t n) {
  return {x.begin() + std::ptrdiff_t(i * n), x.begin() + std::ptrdiff_t((i + 1) * n)};
}

/// The gradient of an environment among others, in either group of a block, is that of its own
/// numbers alone.
TEST(VaryingGradients, OfABatchAreThoseOfScenesOfTheirOwn) {
  for (const auto& [name, lines, count] :
       {std::tuple{"rolling_ball_small", kBall, 1}, {"cap_opening", kCap, 4}}) {
    SCOPED_TRACE(name);
    const Scene scene = varied(name, lines);
    const Model model(scene);
    const Batch start(model, 9, 3);
    const ControlProgram program(model, model.timestep(), 3);
    const auto loss = make_loss(LossKind::tactile, model, 5);
    TapeOptions options;
    options.length = 100;
    options.parameters = options.points = true;
    const RolloutLoss* const losses[] = {loss.get()};
    const LossGradient all =
        rollout_gradients(start, controls_of(program), options, losses).losses[0];
    const std::size_t nv = std::size_t(model.nv()),
                      nu = std::size_t(options.length) * std::size_t(model.nu());
    for (const std::size_t e : {0U, 3U, 8U}) {
      const Model alone(written(scene, start, static_cast<int>(e), std::size_t(count)));
      const Batch one(alone, 1, 3, static_cast<std::int64_t>(e));
      const ControlProgram same(alone, alone.timestep(), 3);
      const auto own_loss = make_loss(LossKind::tactile, alone, 5);
      const RolloutLoss* const own_losses[] = {own_loss.get()};
      const LossGradient own =
          rollout_gradients(one, controls_of(same), options, own_losses).losses[0];
      EXPECT_GT(own.value[0], 0);
      EXPECT_EQ(all.value[e], own.value[0]);
      EXPECT_EQ(part(all.u, e, nu), own.u) << e;
      EXPECT_EQ(part(all.q, e, nv), own.q) << e;
      EXPECT_EQ(part(all.v, e, nv), own.v) << e;
      EXPECT_EQ(part(all.points, e, own.points.size()), own.points) << e;
      ASSERT_EQ(all.parameters.size(), 9 * own.parameters.size());
      const NumberGradients numbers(alone);
      for (std::size_t k = 0; k < own.parameters.size(); ++k)
        EXPECT_NEAR(all.parameters[e * own.parameters.size() + k], own.parameters[k],
                    1e-13 * std::abs(own.parameters[k]))
            << numbers.infos()[k].name;
    }
    EXPECT_NE(part(all.q, 0, nv), part(all.q, 8, nv));
  }
}

}  // namespace
}  // namespace tangere
