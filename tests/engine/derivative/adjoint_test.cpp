// SPDX-License-Identifier: Apache-2.0
// Tests gradients of rollouts: the adjoint against differences of whole runs, for every scheme,
// joint kind, contact law and motor.
#include <gtest/gtest.h>

#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/sanitized.hpp"

namespace tangere {
namespace {

using testing::random_input;
using testing::RunGradient;
using testing::RunInput;
using testing::StateLoss;

constexpr int kSteps = 6;

/// An accuracy for which some steps of these scenes are cut.
double cutting(Integrator scheme) { return scheme.scheme().order > 1 ? 0.01 : 0.1; }

/// Whether cutting changes the run.
bool is_cut(const Scene& scene, Integrator scheme, unsigned seed) {
  const Model model(scene);
  const RunInput in = random_input(model, seed, kSteps);
  const StateLoss loss(model, kSteps, seed + 1);
  StepperOptions options = testing::options(scheme, scene.timestep, 1e-13);
  const double plain = testing::loss_of_run(model, options, in, loss);
  options.accuracy = cutting(scheme);
  return testing::loss_of_run(model, options, in, loss) != plain;
}

/// A ball that leaves the ground straight up: its damping clamps the force while it still touches.
Scene hopping_ball(Integrator scheme, double ks) {
  Scene s;
  s.name = "hop";
  s.integrator = scheme;
  s.timestep = 2e-3;
  s.ground = GroundDescription{};
  s.links = {testing::link("ball", JointType::free, {0, 0, 0.0095}, SphereShape{0.01}, 1000)};
  s.ground_contacts.push_back({"ball", {1e3, 1, 0.6, 2, ks}, ContactLaw::linear, 1e-5, {}});
  return s;
}

class AdjointScheme : public ::testing::TestWithParam<Integrator> {};

/// Without a normal force there is no friction at any speed, so at rest its derivative is 0 too.
TEST_P(AdjointScheme, BallsThatLetGoAtRestMatchDifferences) {
  for (const double ks : {0.0, 50.0}) {
    const Model model(hopping_ball(GetParam(), ks));
    const StepperOptions options = testing::options(GetParam(), 2e-3, 1e-13);
    const StateLoss loss(model, 5, 2);
    RunInput in;
    in.q = testing::q_of(Batch(model, 1));
    in.v.assign(std::size_t(model.nv()), 0.0);
    in.u.resize(5);
    const RunGradient g = testing::adjoint_of_run(model, options, {in}, loss, 0);
    for (int i = 0; i < model.nv(); ++i) {
      const double difference = testing::best_difference(
          [&](double e) {
            RunInput moved = in;
            moved.v[std::size_t(i)] += e;
            return testing::loss_of_run(model, options, moved, loss);
          },
          1e-4);
      EXPECT_NEAR(g.v[std::size_t(i)], difference, 1e-6 * g.norm()) << "dof " << i << ", ks " << ks;
    }
  }
}

TEST_P(AdjointScheme, TreesMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    compared += testing::check_gradient(testing::random_tree(seed, 2 + static_cast<int>(seed % 5)),
                                        GetParam(), seed, kSteps, 1e-7);
  }
  EXPECT_GT(compared, 70);
}

TEST_P(AdjointScheme, MachinesMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    compared +=
        testing::check_gradient(testing::random_machine(seed, 2 + static_cast<int>(seed % 5)),
                                GetParam(), seed, kSteps, 1e-7);
  }
  EXPECT_GT(compared, 150);
}

/// Runs that split are left out: the run jumps where that decision changes, and these contacts are
/// deep enough for it.
TEST_P(AdjointScheme, ContactsMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene =
        testing::random_contacts(seed, 2 + static_cast<int>(seed % 2), ContactLaw(seed % 3));
    if (!testing::splits(scene, GetParam(), seed, kSteps))
      compared += testing::check_gradient(scene, GetParam(), seed, kSteps, 1e-6);
  }
  EXPECT_GT(compared, 60);
}

/// Position motors use the state at the start of the step; one of them drives a ball joint.
TEST_P(AdjointScheme, MotorsTimedAtTheStartMatchDifferences) {
  int motors = 0, compared = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Scene s = testing::random_machine(seed, 3 + static_cast<int>(seed % 3));
    for (MotorDescription& m : s.motors)
      m.timing = MotorTiming::start, motors += m.control == MotorControl::position;
    SCOPED_TRACE("seed " + std::to_string(seed));
    if (!testing::splits(s, GetParam(), seed, kSteps))
      compared += testing::check_gradient(s, GetParam(), seed, kSteps, 1e-7);
  }
  EXPECT_GT(motors, 3);
  EXPECT_GT(compared, 150);
}

/// Scale, offset, ranges of u beyond which the derivative is 0, and several motors of a joint; also
/// shares of gravity.
TEST_P(AdjointScheme, MotorsThatMapTheirControlsMatchDifferences) {
  std::size_t motors = 0;
  int compared = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Scene s = testing::random_machine(seed, 3 + static_cast<int>(seed % 3));
    testing::map_controls(s, seed);
    testing::share_gravity(s, seed);
    if (seed % 2 == 0)
      for (MotorDescription& m : s.motors) m.timing = MotorTiming::start;
    motors += s.motors.size();
    SCOPED_TRACE("seed " + std::to_string(seed));
    if (!testing::splits(s, GetParam(), seed, kSteps))
      compared += testing::check_gradient(s, GetParam(), seed, kSteps, 1e-7);
  }
  EXPECT_GT(motors, 12U);
  EXPECT_GT(compared, 150);
}

/// Steps of which some are cut. Differences hold where both runs cut alike.
TEST_P(AdjointScheme, CutStepsMatchDifferences) {
  if (GetParam().scheme().estimate.empty()) return;  // refused: see StepParts
  constexpr unsigned kSeeds = kSanitized ? 1 : 3;
  int compared = 0;
  unsigned cut = 0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene = testing::random_contacts(seed, 2, ContactLaw(seed % 3));
    cut += is_cut(scene, GetParam(), seed) ? 1 : 0;
    compared += testing::check_gradient(scene, GetParam(), seed, kSteps, 1e-6, cutting(GetParam()));
  }
  EXPECT_GT(compared, 15 * static_cast<int>(kSeeds));
  EXPECT_GE(cut + 1, kSeeds);
}

/// Together with others, alone in its group or in a batch of one, an environment has the same bits.
TEST_P(AdjointScheme, CompanyChangesNothing) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const Scene scene = testing::random_contacts(seed, 3, ContactLaw(seed % 3));
    const Model model(scene);
    const StepperOptions options = testing::options(GetParam(), scene.timestep, 1e-9);
    std::vector<RunInput> inputs;
    for (unsigned k = 0; k < 9; ++k) inputs.push_back(random_input(model, seed + 10 * k, kSteps));
    const StateLoss loss(model, kSteps, seed);
    for (int lane : {0, 5, 8}) {
      const RunGradient alone =
          testing::adjoint_of_run(model, options, {inputs[std::size_t(lane)]}, loss, 0);
      const RunGradient among = testing::adjoint_of_run(model, options, inputs, loss, lane);
      EXPECT_EQ(alone.q, among.q) << "seed " << seed << " lane " << lane;
      EXPECT_EQ(alone.v, among.v);
      EXPECT_EQ(alone.u, among.u);
      EXPECT_EQ(alone.parameters, among.parameters);
    }
  }
}

/// A contact of stiffness zero is left out of steps without a tape, but has a derivative by it.
TEST_P(AdjointScheme, AContactThatNeverPushesHasADerivativeByItsStiffness) {
  Scene scene = testing::rolling_ball(false, 12);
  PairContactDescription& contact = scene.pair_contacts.front();
  contact.coefficients = {0, 1, 1, 0};
  contact.law = ContactLaw::paper;
  scene.initial.push_back({"pad_joint", {0, 0, -0.0155}, {0.1, 0, -0.05}, {}});
  const Model model(scene);
  const StepperOptions options = testing::options(GetParam(), scene.timestep, 1e-13);
  const Batch start(model, 1);
  const RunInput in{testing::q_of(start), testing::v_of(start),
                    std::vector<std::vector<double>>(3, {0.1, 0, 0.1})};
  const StateLoss loss(model, 3, 1);
  const double base = testing::loss_of_run(model, options, in, loss);
  const auto difference = [&](double kn) {
    Scene stiff = scene;
    stiff.pair_contacts.front().coefficients.kn = kn;
    return (testing::loss_of_run(Model(stiff), options, in, loss) - base) / kn;
  };
  const double expected = 2 * difference(5e-6) - difference(1e-5);
  const NumberGradients numbers(model);
  const auto found = std::ranges::find_if(numbers.infos(), [](const NumberInfo& info) {
    return info.number.owner == NumberOwner::contact && info.number.field == NumberField::kn;
  });
  const auto at = std::size_t(found - numbers.infos().begin());
  const double derivative = testing::adjoint_of_run(model, options, {in}, loss, 0).parameters[at];
  EXPECT_GT(std::abs(expected), 1e-3);
  EXPECT_NEAR(derivative, expected, 1e-5 * std::abs(expected));
}

INSTANTIATE_TEST_SUITE_P(All, AdjointScheme, ::testing::ValuesIn(integrators()));

}  // namespace
}  // namespace tangere
