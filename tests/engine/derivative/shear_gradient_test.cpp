// SPDX-License-Identifier: Apache-2.0
// Tests gradients through friction that remembers: the adjoint against differences of whole runs,
// for every scheme, with points that stick, slip, leave and touch again.
#include <gtest/gtest.h>

#include "tests/engine/gradient_run.hpp"
#include "tests/engine/random_scene.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::random_input;
using testing::RunGradient;
using testing::RunInput;
using testing::StateLoss;

constexpr int kSteps = 8;

/// Random bodies that touch each other, a wall and the ground, with springs in all contacts.
Scene elastic_contacts(unsigned seed, int links, ContactLaw law) {
  Scene s = testing::random_contacts(seed, links, law);
  testing::Random random(seed + 5000);
  for (auto& c : s.pair_contacts) c.coefficients.ks = random.uniform(10, 200);
  for (auto& c : s.ground_contacts) c.coefficients.ks = random.uniform(10, 200);
  return s;
}

double norm(const std::vector<double>& x) {
  double sum = 0;
  for (const double a : x)
    if (std::isfinite(a)) sum += a * a;
  return std::sqrt(sum);
}

int compare(const std::vector<double>& a, const std::vector<double>& b, double tolerance,
            const char* what) {
  int compared = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(b[i])) continue;
    EXPECT_NEAR(a[i], b[i], tolerance * norm(b)) << what << " " << i;
    ++compared;
  }
  return compared;
}

int check(const Scene& scene, Integrator scheme, unsigned seed, double tolerance) {
  const Model model(scene);
  const StepperOptions options = testing::options(scheme, scene.timestep, 1e-13);
  const RunInput in = random_input(model, seed, kSteps);
  const StateLoss loss(model, kSteps, seed + 1);
  if (!std::isfinite(testing::loss_of_run(model, options, in, loss))) return 0;
  const RunGradient adjoint = testing::adjoint_of_run(model, options, {in}, loss, 0);
  const RunGradient difference = testing::differences_of_run(model, options, in, loss);
  int compared = compare(adjoint.q, difference.q, tolerance, "q");
  compared += compare(adjoint.v, difference.v, tolerance, "v");
  compared += compare(adjoint.u, difference.u, tolerance, "u");
  const NumberGradients parameters(model);
  std::vector<double> a = adjoint.parameters, b = difference.parameters;
  const double scale = [&] {
    for (std::size_t k = 0; k < a.size(); ++k) {
      const double size = parameters.infos()[k].value;
      a[k] *= size, b[k] *= size;
    }
    return norm(b);
  }();
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (!std::isfinite(b[k])) continue;
    EXPECT_NEAR(a[k], b[k], tolerance * scale) << parameters.infos()[k].name;
    ++compared;
  }
  return compared;
}

/// Whether a step of the run is split: the run jumps where that decision changes.
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

class ShearGradient : public ::testing::TestWithParam<Integrator> {};

TEST_P(ShearGradient, ContactsMatchDifferences) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Scene scene =
        elastic_contacts(seed, 2 + static_cast<int>(seed % 2), ContactLaw(seed % 3));
    if (!splits(scene, GetParam(), seed)) compared += check(scene, GetParam(), seed, 1e-6);
  }
  EXPECT_GT(compared, 130);
}

INSTANTIATE_TEST_SUITE_P(Schemes, ShearGradient,
                         ::testing::ValuesIn(testing::all_integrators()),
                         [](const auto& info) { return std::string(to_string(info.param)); });

}  // namespace
}  // namespace tangere
