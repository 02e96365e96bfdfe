// SPDX-License-Identifier: Apache-2.0
// Tests that a check fails where a derivative is wrong or does not exist, and says why.
#include "tasks/gradients/gradient_check.hpp"

#include <gmock/gmock.h>

#include "engine/step/control.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/gradients/losses.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// Another loss, whose derivatives by the velocities are off by a factor.
class WrongLoss : public RolloutLoss {
 public:
  WrongLoss(const Model& model, double factor)
      : right_(make_loss(LossKind::path, model, 1)), factor_(factor) {}
  [[nodiscard]] bool reads_fields(std::int64_t) const override { return false; }
  double evaluate(const LossPoint& at, const LossCotangent& out) const override {
    std::vector<double> before(out.v.begin(), out.v.end());
    const double value = right_->evaluate(at, out);
    for (std::size_t i = 0; i < before.size(); ++i)
      out.v[i] = before[i] + factor_ * (out.v[i] - before[i]);
    return value;
  }

 private:
  std::unique_ptr<RolloutLoss> right_;
  double factor_;
};

/// A ball that comes down at 1 m/s, 10 mm in a step, on a ground that pushes as a spring.
Scene coming(double height) {
  return parse_scene(R"(<tangere model="coming">
  <option unit="m-kg" gravity="0 0 0" timestep="1e-2" integrator="BDF1"/>
  <ground pos="0 0 0" normal="0 0 1"/>
  <default><ground_contact kn="1e2" kt="0" mu="0" damping="0"/></default>
  <robot>
    <link name="ball">
      <joint name="fall" type="prismatic" axis="0 0 1" pos="0 0 )" +
                         std::to_string(0.02 + height) + R"("/>
      <body name="ball" type="sphere" radius="0.02" density="1000"/>
    </link>
  </robot>
  <contact><ground_contact body="ball"/></contact>
  <initial><joint name="fall" v="-1"/></initial>
</tangere>)",
                     "coming.xml")
      .scene;
}

GradientCheck check(const Model& model, const RolloutLoss& loss, std::int64_t steps) {
  CheckOptions options;
  options.length = steps;
  options.entries = 0;
  options.stepper.tolerance = 1e-12;
  const ControlProgram controls(model, model.timestep(), 0);
  return check_gradient(
      Batch(model, 1),
      [&](std::int64_t t, int e, std::span<double> u) { controls.evaluate(t, e, u); }, loss,
      options);
}

TEST(GradientCheck, FailsWhereALossHasAWrongDerivative) {
  const Model model(coming(0.012));
  const GradientCheck right = check(model, WrongLoss(model, 1), 10);
  EXPECT_TRUE(right.passed()) << right.max_relative_error();
  EXPECT_LT(right.max_relative_error(), 1e-6);
  EXPECT_THAT(right.reasons, IsEmpty());
  const GradientCheck wrong = check(model, WrongLoss(model, 1.01), 10);
  EXPECT_FALSE(wrong.passed());
  EXPECT_NEAR(wrong.max_relative_error(), 0.01, 1e-3);
  EXPECT_THAT(wrong.reasons, Contains(HasSubstr("a wrong derivative is left")))
      << "no decision of the runs explains the error";
}

/// After the second step the ball just touches. Differences see half of the force, whatever the
/// change is, and the derivative is that of one side.
TEST(GradientCheck, NamesTheContactOfAKink) {
  const Model model(coming(0.02));
  const GradientCheck found = check(model, *make_loss(LossKind::path, model, 1), 2);
  EXPECT_FALSE(found.passed());
  EXPECT_THAT(found.reasons,
              Contains(AllOf(HasSubstr("q, fall"), HasSubstr("in state 2"),
                             HasSubstr("the contact of 'ball' with 'ground' touch"))));
  EXPECT_TRUE(check(Model(coming(0.021)), *make_loss(LossKind::path, model, 1), 2).passed());
}

TEST(GradientCheck, NamesRoundedReadings) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/identify_ball.xml").scene;
  scene.sensors[0].array.rows = scene.sensors[0].array.cols = 8;
  const auto checked = [](const Scene& of) {
    const Model model(of);
    CheckOptions options;
    options.length = 20;
    options.entries = 3;
    options.stepper.tolerance = 1e-12;
    const ControlProgram controls(model, model.timestep(), 0);
    return check_gradient(
        Batch(model, 1),
        [&](std::int64_t t, int e, std::span<double> u) { controls.evaluate(t, e, u); },
        *make_loss(LossKind::tactile, model, 2), options);
  };
  const GradientCheck ideal = checked(scene);
  EXPECT_TRUE(ideal.passed()) << ideal.max_relative_error();
  EXPECT_THAT(ideal.reasons, Each(Not(HasSubstr("quantisation"))));
  scene.sensors[0].imperfections.quantisation = {1e-3, 2e-3};
  const GradientCheck rounded = checked(scene);
  EXPECT_FALSE(rounded.passed());
  EXPECT_GT(rounded.max_relative_error(), 0.1);
  EXPECT_THAT(rounded.reasons,
              Contains(AllOf(HasSubstr("sensor 'pad'"), HasSubstr("quantisation"),
                             HasSubstr("0.001 N (pressure) and 0.002 N (shear)"))));
}

}  // namespace
}  // namespace tangere
