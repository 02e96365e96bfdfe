// SPDX-License-Identifier: Apache-2.0
// Tests adjoint, tangents in dual numbers and differences of whole rollouts on every scene of a
// task, over 1 to 350 steps, under the usual schemes. Also tests what the published code gets
// wrong.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "engine/derivative/number_gradients.hpp"
#include "engine/step/control.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/gradients/gradient_check.hpp"
#include "tasks/gradients/losses.hpp"

namespace tangere {
namespace {

Scene shipped(const std::string& name) {
  return read_scene(TANGERE_SOURCE_DIR "/scenes/" + name + ".xml").scene;
}

/// Checks a shipped scene under a scheme.
GradientCheck check(const Scene& scene, LossKind kind, std::int64_t steps, int entries) {
  const Model model(scene);
  const Batch start(model, 1, 3);
  const ControlProgram program(model, model.timestep(), 3);
  const auto loss = make_loss(kind, model, steps < 5 ? 1 : 5);
  CheckOptions options;
  options.length = steps;
  options.entries = entries;
  options.settled = 1e-6;
  options.stepper.tolerance = 1e-12;
  return check_gradient(
      start, [&](std::int64_t step, int e, std::span<double> u) { program.evaluate(step, e, u); },
      *loss, options);
}

struct Routes {
  const char* scene;
  Integrator scheme;
  LossKind loss;
  bool longest;  ///< also over 350 steps
};
void PrintTo(const Routes& r, std::ostream* out) {
  *out << r.scene << " " << to_string(r.scheme) << " " << to_string(r.loss);
}

class EveryScene : public ::testing::TestWithParam<Routes> {};

/// Half squares of speeds and of shear resemble those of states and of fields, so short runs are
/// enough.
std::vector<std::int64_t> lengths(const Routes& r) {
  if (r.loss == LossKind::path || r.loss == LossKind::shear) return {1, 20};
  return r.longest ? std::vector<std::int64_t>{1, 20, 350} : std::vector<std::int64_t>{1, 20, 100};
}

TEST_P(EveryScene, ThreeRoutesAgreeOverAnyLength) {
  Scene scene = shipped(GetParam().scene);
  scene.integrator = GetParam().scheme;
  std::map<std::string, std::size_t> compared;
  for (const std::int64_t steps : lengths(GetParam())) {
    const GradientCheck c = check(scene, GetParam().loss, steps, steps > 100 ? 1 : 2);
    const double tolerance = steps > 100 ? 1e-5 : 1e-6;
    for (const CheckedInput& i : c.inputs) {
      EXPECT_LE(i.difference_error, tolerance)
          << i.name << " at " << i.worst << ", " << steps << " steps";
      EXPECT_LE(i.tangent_error, tolerance) << i.name << ", " << steps << " steps";
      EXPECT_TRUE(i.norm > 0 || steps < 100) << i.name << ", " << steps << " steps";
    }
    for (const CheckedInput& i : c.inputs)
      if (i.influence && (i.name == "numbers" || i.name == "points"))
        compared[i.name] += i.compared;
    // The motors of cap opening have long forgotten its start. Differences by the start drown in
    // the loss.
    EXPECT_TRUE(steps != 100 || c.entries() > 0) << c.kinks() << " kinks";
  }
  for (const auto& [input, count] : compared) EXPECT_GT(count, 0U) << input;
}

/// Runs of 100 and of 350 steps take turns: each scene and each of its schemes has both, and over
/// the scenes each loss has both under each scheme.
std::vector<Routes> all_routes() {
  std::vector<Routes> all;
  bool longest = false;
  for (const char* scene :
       {"rolling_ball_small", "box_pushing", "stable_grasp", "cap_opening", "insertion"}) {
    for (const Integrator scheme : {Integrator::bdf1, Integrator::bdf2}) {
      for (const LossKind loss : {LossKind::final_state, LossKind::path, LossKind::tactile,
                                  LossKind::shear, LossKind::end_effectors})
        if (loss != LossKind::end_effectors || Model(shipped(scene)).end_effectors().size() > 0)
          all.push_back({scene, scheme, loss, longest != (loss == LossKind::tactile)});
      longest = !longest;
    }
    longest = !longest;
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene, ::testing::ValuesIn(all_routes()));

void expect_right(const GradientCheck& c, double tolerance) {
  for (const CheckedInput& i : c.inputs) {
    EXPECT_GT(i.norm, 0) << i.name;
    EXPECT_LE(i.difference_error, tolerance) << i.name << " at " << i.worst;
    EXPECT_LE(i.tangent_error, 1e-10) << i.name;
  }
  EXPECT_GT(c.inputs[0].compared, 0U);
  EXPECT_GE(c.entries(), 10U) << c.kinks() << " kinks";
}

/// The published gradient is 0 there, because that code keeps derivatives of fields only for BDF1.
TEST(PublishedFaults, TactileLossUnderBdf2IsNotZero) {
  Scene scene = shipped("rolling_ball_small");
  scene.integrator = Integrator::bdf2;
  expect_right(check(scene, LossKind::tactile, 120, 6), 1e-6);
}

/// Markers of a gel move linearly with the field, so their gradient is the field's.
TEST(Markers, ThreeRoutesAgree) {
  for (const Integrator scheme : {Integrator::bdf1, Integrator::bdf2}) {
    Scene scene = shipped("rolling_ball_small");
    scene.integrator = scheme;
    scene.sensors[0].markers = MarkersDescription{0.01, 2e-3, 1e-3, {}};
    expect_right(check(scene, LossKind::markers, 120, 6), 1e-6);
  }
}

/// Channels are quadratic in the field.
TEST(Channels, ThreeRoutesAgree) {
  for (const bool shear : {false, true}) {
    ChannelMap map;
    map.rows = 2, map.cols = 3, map.shear = shear;
    map.names = {"one", "two"};
    map.offset = {4, -3};
    for (std::size_t k = 0; k < 2 * map.loads(); ++k)
      map.linear.push_back(std::cos(1.0 + double(k)));
    for (std::size_t k = 0; k < 2 * map.pairs(); ++k)
      map.quadratic.push_back(3 * std::sin(2.0 + double(k)));
    Scene scene = shipped("rolling_ball_small");
    scene.sensors[0].channels.emplace();
    scene.sensors[0].channels->noise = 2;  // of readings, not of the loss
    scene.sensors[0].channels->map = std::make_shared<const ChannelMap>(map);
    expect_right(check(scene, LossKind::channels, 120, 6), 1e-6);
    scene.sensors[0].channels.reset();
    EXPECT_THROW(check(scene, LossKind::channels, 120, 6), InputError);
  }
}

/// Pictures of a layer follow from its field.
TEST(Pictures, ThreeRoutesAgree) {
  Scene scene = shipped("gel_press");
  std::erase_if(scene.randomizations,
                [](const auto& d) { return d.number.field == NumberField::kn; });
  PictureDescription& picture = scene.sensors[0].picture.emplace();
  picture.rows = 9, picture.cols = 12;
  picture.gel = std::make_shared<const Gel>(default_gel());
  scene.sensors[0].array.rows = 16, scene.sensors[0].array.cols = 20;
  scene.sensors[0].layer->cell = 0;
  expect_right(check(scene, LossKind::pictures, 60, 6), 1e-5);
  scene.sensors[0].layer.reset();
  EXPECT_THROW(check(scene, LossKind::pictures, 60, 60), InputError);
}

/// The published gradient is 5 to 107 % off: the contact point of a sphere moves over it.
TEST(PublishedFaults, RollingBallGradientIsRight) {
  for (const Integrator scheme : {Integrator::bdf1, Integrator::bdf2}) {
    Scene scene = shipped("rolling_ball_small");
    scene.integrator = scheme;
    expect_right(check(scene, LossKind::final_state, 150, 6), 1e-6);
  }
}

/// The published gradient is 38 to 108 % off: the motor's force follows the state that the step
/// solves for.
TEST(PublishedFaults, PositionControlGradientIsRight) {
  for (const char* name : {"insertion", "cap_opening"})
    for (const MotorTiming timing : {MotorTiming::end, MotorTiming::start}) {
      Scene scene = shipped(name);
      int motors = 0;
      for (MotorDescription& motor : scene.motors) {
        if (motor.control != MotorControl::position) continue;
        ++motors;
        motor.timing = timing;
        if (timing == MotorTiming::start)
          motor.P *= 0.1, motor.D *= 0.1;  // with explicit timing they are unstable at full gain
      }
      EXPECT_GT(motors, 0);
      expect_right(check(scene, LossKind::final_state, 20, 4), 1e-6);
    }
}

LossGradient gradient(const Model& model, std::int64_t steps, double tolerance,
                      Precision precision) {
  const ControlProgram program(model, model.timestep(), 3);
  const auto loss = make_loss(LossKind::shear, model, 5);
  const RolloutLoss* const losses[] = {loss.get()};
  TapeOptions options;
  options.length = steps;
  options.stepper.tolerance = tolerance;
  options.precision = precision;
  options.parameters = true;
  return rollout_gradients(
             Batch(model, 1, 3),
             [&](std::int64_t step, int e, std::span<double> u) { program.evaluate(step, e, u); },
             options, losses)
      .losses[0];
}

/// |a - b| / |b| over controls, start and numbers (by their relative change).
double distance(const Model& model, const LossGradient& a, const LossGradient& b) {
  const NumberGradients parameters(model);
  double worst = 0;
  const auto part = [&](const std::vector<double>& x, const std::vector<double>& y,
                        const auto& scale) {
    double off = 0, norm = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      off += std::pow(scale(i) * (x[i] - y[i]), 2);
      norm += std::pow(scale(i) * y[i], 2);
    }
    EXPECT_GT(norm, 0);
    worst = std::max(worst, std::sqrt(off / norm));
  };
  const auto as_it_is = [](std::size_t) { return 1.0; };
  part(a.u, b.u, as_it_is);
  part(a.q, b.q, as_it_is);
  part(a.v, b.v, as_it_is);
  part(a.parameters, b.parameters, [&](std::size_t k) { return parameters.infos()[k].value; });
  return worst;
}

/// The residual of a solve is the only error. With the factor that Newton's search left, the error
/// would be proportional to the tolerance's root.
TEST(Gradients, TheirErrorIsProportionalToTheTolerance) {
  for (const char* name : {"rolling_ball_small", "box_pushing", "stable_grasp"}) {
    const Model model(shipped(name));
    const LossGradient exact = gradient(model, 100, 1e-13, Precision::f64);
    const auto error = [&](double tolerance) {
      return distance(model, gradient(model, 100, tolerance, Precision::f64), exact);
    };
    const double coarse = error(1e-4), fine = error(1e-8), own = error(kGradientTolerance);
    RecordProperty(std::string(name) + "_1e-4", std::to_string(coarse * 1e4));
    RecordProperty(std::string(name) + "_1e-8", std::to_string(fine * 1e8));
    EXPECT_LE(coarse, 3e3 * 1e-4) << name;
    EXPECT_LE(fine, 3e3 * 1e-8) << name;
    EXPECT_LE(fine, 2e-3 * coarse) << name << ": a root would be 1e-2";
    EXPECT_LE(own, 1e-6) << name << " at the default";
  }
}

/// With fields in float, λᵀ(Jd) equals (Jᵀλ)ᵀd to single precision, because tangents use no floats.
TEST(Gradients, FieldsInFloatKeepTheDotProduct) {
  for (const char* name : {"rolling_ball_small", "box_pushing", "stable_grasp", "insertion"}) {
    const Model model(shipped(name));
    const double off = distance(model, gradient(model, 100, 1e-12, Precision::mixed),
                                gradient(model, 100, 1e-12, Precision::f64));
    EXPECT_GT(off, 0) << name << ": nothing was in float";
    EXPECT_LE(off, 1e-5) << name;
  }
}

}  // namespace
}  // namespace tangere
