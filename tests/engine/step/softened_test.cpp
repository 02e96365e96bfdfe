// SPDX-License-Identifier: Apache-2.0
// Tests steps whose contacts are too stiff for a search from the first guess: roots are approached
// from softer contacts, depend on nothing but their environment, and have exact gradients.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/derivative/adjoint.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/step/control.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/engine/runs.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using testing::q_of;
using testing::v_of;

/// A scene with contacts that are stiffer than it was made for.
struct StiffScene {
  const char* name;
  double kn, kt;
  Integrator scheme;
  int steps;
};
void PrintTo(const StiffScene& of, std::ostream* out) {
  *out << of.name << ' ' << to_string(of.scheme);
}
Model model_of(const StiffScene& of) {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/" + std::string(of.name) + ".xml").scene;
  const auto stiffen = [&](ContactCoefficients& c) { c.kn *= of.kn, c.kt *= of.kt; };
  for (auto& contact : scene.pair_contacts) stiffen(contact.coefficients);
  for (auto& contact : scene.ground_contacts) stiffen(contact.coefficients);
  scene.randomizations.clear();
  return Model(scene);
}

/// The scene's own controls, a little other ones in each environment.
std::vector<double> controls(const Model& model, int step, int e) {
  const ControlProgram program(model, model.timestep(), 0);
  std::vector<double> u(std::size_t(model.nu()));
  program.evaluate(step, 0, u);
  for (std::size_t i = 0; i < u.size(); ++i) u[i] += 0.01 * std::sin(double(e) + double(i));
  return u;
}
std::vector<double> controls_of_all(const Model& model, int step, int environments) {
  std::vector<double> all;
  for (int e = 0; e < environments; ++e) {
    const std::vector<double> u = controls(model, step, e);
    all.insert(all.end(), u.begin(), u.end());
  }
  return all;
}

class Softened : public ::testing::TestWithParam<StiffScene> {
 protected:
  static StepperOptions options_for(const Model& model) {
    return testing::options(GetParam().scheme, model.timestep(), 1e-6);
  }
};

TEST_P(Softened, StiffContactsSeldomNeedSplitting) {
  const Model model = model_of(GetParam());
  Stepper stepper(model, options_for(model));
  Batch batch(model, kernels::kBlock);
  double passes = 0;
  int split = 0;
  for (int k = 0; k < GetParam().steps; ++k) {
    stepper.step(batch, controls_of_all(model, k, batch.environments()));
    for (int e = 0; e < batch.environments(); ++e) {
      ASSERT_FALSE(failed(batch.status(e))) << "step " << k << ", environment " << e;
      split += batch.status(e) == StepStatus::split;
    }
    for (const int i : batch.iterations()) passes += i;
  }
  const double steps = GetParam().steps * batch.environments();
  EXPECT_GT(passes, 4 * steps) << "these steps are not hard";
  EXPECT_LT(split, 0.1 * steps);
}

TEST_P(Softened, AnEnvironmentHasTheSameBitsAloneAndInABatch) {
  const Model model = model_of(GetParam());
  Stepper stepper(model, options_for(model));
  Batch all(model, kernels::kBlock);
  std::vector<Batch> alone(kernels::kBlock, Batch(model, 1));
  for (int k = 0; k < GetParam().steps; ++k) {
    stepper.step(all, controls_of_all(model, k, all.environments()));
    for (int e = 0; e < all.environments(); ++e) {
      Batch& one = alone[std::size_t(e)];
      stepper.step(one, controls(model, k, e));
      ASSERT_EQ(q_of(all, e), q_of(one)) << "step " << k << ", environment " << e;
      ASSERT_EQ(v_of(all, e), v_of(one)) << "step " << k << ", environment " << e;
      ASSERT_EQ(all.iterations()[std::size_t(e)], one.iterations()[0]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Stiff, Softened,
    ::testing::Values(StiffScene{"box_pushing", 1, 1e4, Integrator::bdf1, 60},
                      StiffScene{"box_pushing", 1, 1e4, Integrator::sdirk2, 60},
                      StiffScene{"rolling_ball_small", 1e3, 1, Integrator::bdf2, 200},
                      StiffScene{"cap_opening", 1e6, 1, Integrator::bdf1, 40}));

/// Of a box whose friction is ten thousand times as stiff, in all steps but the first approached
/// from less.
class SoftenedGradients : public ::testing::Test {
 protected:
  using Vector = std::vector<double>;
  static constexpr int kLane = 3, kFewSteps = 12;

  SoftenedGradients() { play(batch, &tape); }
  void play(Batch& from, BlockTape* to) {
    if (to != nullptr) to->start(from, 0);
    for (int t = 0; t < kFewSteps; ++t)
      stepper.step_block(from, 0, controls_of_all(model, t, from.environments()), to);
  }
  Vector drawn() {
    Vector x(std::size_t(model.nv()));
    for (double& a : x) a = random.normal();
    return x;
  }

  const StiffScene scene{"box_pushing", 1, 1e4, Integrator::bdf1, kFewSteps};
  const Model model = model_of(scene);
  const StepperOptions options = testing::options(scene.scheme, model.timestep(), 1e-11);
  Stepper stepper{model, options};
  Batch batch{model, kernels::kBlock};
  BlockTape tape{model, scene.scheme, kFewSteps};
  testing::Random random{3};
};

TEST_F(SoftenedGradients, TangentsAreDifferences) {
  const Vector v = drawn();
  StateTangent state{Vector(v.size()), v, Vector(v.size()), Vector(v.size())};
  Tangent tangent(model, options);
  const Vector still(std::size_t(model.nu()));
  int split = 0;
  for (int t = 0; t < kFewSteps; ++t) {
    split += tape.special(t, kLane) != nullptr;
    tangent.step(batch, 0, kLane, tape, t, controls(model, t, kLane), still, {}, state);
  }
  EXPECT_EQ(split, 0);
  constexpr double kDelta = 1e-8;
  const auto end = [&](double by) {
    Batch moved(model, kernels::kBlock);
    Vector v0 = v_of(moved, kLane);
    for (std::size_t i = 0; i < v.size(); ++i) v0[i] += by * v[i];
    moved.set_state(kLane, q_of(moved, kLane), v0);
    play(moved, nullptr);
    return q_of(moved, kLane);
  };
  const Vector up = end(kDelta), down = end(-kDelta);
  double largest = 0;
  for (const double x : state.q) largest = std::max(largest, std::abs(x));
  for (std::size_t i = 0; i < v.size(); ++i)
    EXPECT_NEAR((up[i] - down[i]) / (2 * kDelta), state.q[i], 3e-5 * largest) << i;
}

TEST_F(SoftenedGradients, AdjointsAreTangents) {
  const Vector q = drawn(), v = drawn(), q_bar = drawn(), v_bar = drawn();
  StateTangent state{q, v, Vector(q.size()), Vector(q.size())};
  Tangent tangent(model, options);
  const Vector still(std::size_t(model.nu()));
  for (int t = 0; t < kFewSteps; ++t)
    tangent.step(batch, 0, kLane, tape, t, controls(model, t, kLane), still, {}, state);
  Adjoint adjoint(model, options);
  adjoint.clear();
  BlockCotangent& bar = adjoint.loss(0);
  const auto at = [](std::size_t i) { return i * kernels::kBlock + kLane; };
  for (std::size_t i = 0; i < q.size(); ++i) bar.q[at(i)] = q_bar[i], bar.v[at(i)] = v_bar[i];
  for (int t = kFewSteps; t-- > 0;)
    adjoint.reverse_step(batch, 0, tape, t, controls_of_all(model, t, batch.environments()));
  double forward = 0, backward = 0, size = 0;
  for (std::size_t i = 0; i < q.size(); ++i) {
    forward += q_bar[i] * state.q[i] + v_bar[i] * state.v[i];
    backward += bar.q[at(i)] * q[i] + bar.v[at(i)] * v[i];
    size += std::abs(q_bar[i] * state.q[i]) + std::abs(v_bar[i] * state.v[i]);
  }
  EXPECT_NEAR(forward, backward, 1e-9 * size);
}

}  // namespace
}  // namespace tangere
