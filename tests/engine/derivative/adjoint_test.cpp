// SPDX-License-Identifier: Apache-2.0
// Tests gradients of rollouts: the adjoint against differences of whole runs, for every scheme,
// joint kind, contact law and motor.
#include <gtest/gtest.h>

#include "tests/engine/gradient_run.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/sanitized.hpp"

namespace tangere {
namespace {

using testing::random_input;
using testing::RunGradient;
using testing::RunInput;
using testing::StateLoss;

constexpr int kSteps = 6;

/// Compares every entry relative to the gradient's norm over its group. Returns how many it
/// compared.
int compare(const std::vector<double>& a, const std::vector<double>& b, double scale,
            double tolerance, const char* what) {
  int compared = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(b[i])) continue;
    EXPECT_NEAR(a[i], b[i], tolerance * scale) << what << " " << i;
    ++compared;
  }
  return compared;
}

double norm(const std::vector<double>& x) {
  double sum = 0;
  for (double a : x)
    if (std::isfinite(a)) sum += a * a;
  return std::sqrt(sum);
}

/// Returns how many derivatives were compared; 0 if a step of the run finds no solution.
int check(const Scene& scene, Integrator scheme, unsigned seed, double tolerance,
          double accuracy = 0) {
  const Model model(scene);
  StepperOptions options = testing::options(scheme, scene.timestep, 1e-13);
  options.accuracy = accuracy;
  const RunInput in = random_input(model, seed, kSteps);
  const StateLoss loss(model, kSteps, seed + 1);
  if (!std::isfinite(testing::loss_of_run(model, options, in, loss))) return 0;
  const RunGradient adjoint = testing::adjoint_of_run(model, options, {in}, loss, 0);
  const RunGradient difference = testing::differences_of_run(model, options, in, loss);
  int compared = compare(adjoint.q, difference.q, norm(difference.q), tolerance, "q");
  compared += compare(adjoint.v, difference.v, norm(difference.v), tolerance, "v");
  compared += compare(adjoint.u, difference.u, norm(difference.u), tolerance, "u");
  const NumberGradients parameters(model);
  std::vector<double> a = adjoint.parameters,
                      b = difference.parameters;  // by their relative changes: units differ
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double size = parameters.infos()[k].value;
    a[k] *= size, b[k] *= size;
  }
  const double scale = norm(b);
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (!std::isfinite(b[k])) continue;
    EXPECT_NEAR(a[k], b[k], tolerance * scale) << parameters.infos()[k].name;
    ++compared;
  }
  return compared;
}

/// Whether a step of the run is split. The run jumps where that decision changes, and a difference
/// across the jump is no derivative.
bool splits(const Scene& scene, Integrator scheme, unsigned seed) {
  const Model model(scene);
  const RunInput in = random_input(model, seed, kSteps);
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, testing::options(scheme, scene.timestep, 1e-13));
  bool split = false;
  for (const std::vector<double>& u : in.u) {
    stepper.step(batch, u);
    split = split || batch.status(0) == StepStatus::split;
  }
  return split;
}

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

class AdjointScheme : public ::testing::TestWithParam<Integrator> {};

TEST_P(AdjointScheme, TreesMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    compared +=
        check(testing::random_tree(seed, 2 + static_cast<int>(seed % 5)), GetParam(), seed, 1e-7);
  }
  EXPECT_GT(compared, 150);
}

TEST_P(AdjointScheme, MachinesMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    compared += check(testing::random_machine(seed, 2 + static_cast<int>(seed % 5)), GetParam(),
                      seed, 1e-7);
  }
  EXPECT_GT(compared, 350);
}

/// Runs that split are left out: the run jumps where that decision changes, and these contacts are
/// deep enough for it.
TEST_P(AdjointScheme, ContactsMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene =
        testing::random_contacts(seed, 2 + static_cast<int>(seed % 2), ContactLaw(seed % 3));
    if (!splits(scene, GetParam(), seed)) compared += check(scene, GetParam(), seed, 1e-6);
  }
  EXPECT_GT(compared, 130);
}

/// Position motors use the state at the start of the step; one of them drives a ball joint.
TEST_P(AdjointScheme, MotorsTimedAtTheStartMatchDifferences) {
  int motors = 0, compared = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Scene s = testing::random_machine(seed, 3 + static_cast<int>(seed % 3));
    for (MotorDescription& m : s.motors)
      m.timing = MotorTiming::start, motors += m.control == MotorControl::position;
    SCOPED_TRACE("seed " + std::to_string(seed));
    if (!splits(s, GetParam(), seed)) compared += check(s, GetParam(), seed, 1e-7);
  }
  EXPECT_GT(motors, 10);
  EXPECT_GT(compared, 500);
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
    compared += check(scene, GetParam(), seed, 1e-6, cutting(GetParam()));
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

INSTANTIATE_TEST_SUITE_P(All, AdjointScheme, ::testing::ValuesIn(integrators()));

}  // namespace
}  // namespace tangere
