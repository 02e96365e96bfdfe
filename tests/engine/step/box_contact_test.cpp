// SPDX-License-Identifier: Apache-2.0
// Tests that boxes hold each other: stacks stand, whatever scheme, step and stiffness, fast boxes
// do not pass thin plates, and boxes slide over seams. Faces are chosen per solve, so the bits and
// the derivatives of such contacts are tested here too.
#include <gtest/gtest.h>

#include <cmath>

#include "kernels/numbers/dual.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/engine/stage_buffers.hpp"
#include "tests/sanitized.hpp"

namespace tangere {
namespace {

using testing::link;

constexpr double kEdge = 0.05, kDensity = 1000;
constexpr double kStanding = kSanitized ? 0.2 : 3;  // [s]

Shape box(const Vector3& size) { return CuboidShape{size, {2, 2, 2}}; }

/// Every two neighbours of the stack touch each other with their own corners.
void touch(Scene& s, const std::string& a, const std::string& b, double kn, bool both) {
  const ContactCoefficients c = {kn, 20, 0.8, 0.1 * kn};
  s.pair_contacts.push_back({a, b, c, ContactLaw::clamped, 1e-5, {}});
  if (both) s.pair_contacts.push_back({b, a, c, ContactLaw::clamped, 1e-5, {}});
}

/// Boxes of these edges [m] on a fixed base of 0.2 m, each on the one before.
Scene stack(const std::vector<double>& edges, double kn, bool both) {
  Scene s;
  s.name = "stack";
  s.links = {link("base", JointType::fixed, {0, 0, -0.01}, box({0.2, 0.2, 0.02}), kDensity)};
  double top = 0;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const double a = edges[i];
    s.links.push_back(link("box" + std::to_string(i), JointType::free, {0, 0, top + a / 2},
                           box({a, a, a}), kDensity));
    top += a;
    touch(s, s.links[i + 1].body.name, s.links[i].body.name, kn, both);
  }
  return s;
}

/// Runs for a time [s] and expects every box to stay where it was, but for the depth at which the
/// corners below it carry what is above.
void expect_stands(const Scene& scene, Integrator scheme, double h, double time, double depth) {
  const Model model(scene);
  Batch batch(model, 1);
  Stepper stepper(model, testing::options(scheme, h, 1e-9));
  for (int t = 0; t < int(std::lround(time / h)); ++t) {
    stepper.step(batch, {});
    ASSERT_FALSE(failed(batch.status(0))) << "step " << t;
  }
  const std::vector<double> q = testing::q_of(batch);
  const std::size_t count = scene.links.size() - 1;
  for (std::size_t i = 0; i < count; ++i) {
    EXPECT_NEAR(q[7 * i], 0, 2e-3) << "box " << i;
    EXPECT_NEAR(q[7 * i + 1], 0, 2e-3) << "box " << i;
    EXPECT_LT(q[7 * i + 2], 1e-4) << "box " << i;
    EXPECT_GT(q[7 * i + 2], -depth) << "box " << i;
    EXPECT_GT(std::abs(q[7 * i + 3]), 0.9998) << "box " << i << " tilts";
  }
}

class Stack : public ::testing::TestWithParam<std::tuple<Integrator, double, double>> {};

TEST_P(Stack, FiveEqualBoxesStand) {
  const auto [scheme, h, kn] = GetParam();
  const double weight = kDensity * kEdge * kEdge * kEdge * 9.8;
  for (const bool both : {false, true}) {
    SCOPED_TRACE(both ? "both ways" : "one way");
    // 5 + 4 + … + 1 weights on four corners each, and a margin for what rings
    expect_stands(stack({kEdge, kEdge, kEdge, kEdge, kEdge}, kn, both), scheme, h, kStanding,
                  15 * weight / (4 * kn) * 1.5 + 1e-4);
  }
}

TEST_P(Stack, UnequalBoxesStand) {
  const auto [scheme, h, kn] = GetParam();
  expect_stands(stack({0.08, 0.05, 0.06, 0.03, 0.04}, kn, true), scheme, h, 1,
                40 * kDensity * 0.08 * 0.08 * 0.08 * 9.8 / (4 * kn) + 1e-4);
}

INSTANTIATE_TEST_SUITE_P(
    All, Stack,
    ::testing::Combine(::testing::ValuesIn(integrators().begin(), integrators().end()),
                       ::testing::Values(1e-3, 5e-3, 20e-3), ::testing::Values(1e3, 1e4, 1e5)));

/// A box of 50 mm above a fixed plate, 0.3 m wide.
Scene plate_below(double thickness, double kn, const Vector3& at = {0.01, -0.02, 0.03}) {
  Scene s;
  s.name = "plate";
  s.timestep = 5e-3;
  s.links = {link("plate", JointType::fixed, {0, 0, -thickness / 2}, box({0.3, 0.3, thickness}), 1),
             link("box", JointType::free, at, box({kEdge, kEdge, kEdge}), kDensity)};
  s.pair_contacts.push_back({"box", "plate", {kn, 5, 0.5, 0}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

double energy(const Scene& scene, const std::vector<double>& q, const std::vector<double>& v) {
  const double mass = kDensity * kEdge * kEdge * kEdge, inertia = mass * kEdge * kEdge / 6;
  const auto square = [](const double* a) { return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]; };
  return 0.5 * mass * square(v.data()) + 0.5 * inertia * square(v.data() + 3) -
         mass * scene.gravity[2] * q[2];
}

TEST(FastBox, DoesNotPassAThinPlate) {
  struct Fall {
    double speed, thickness, kn;
  };
  for (const Fall& f :
       {Fall{1.5, 0.01, 1e4}, Fall{5, 0.01, 1e4}, Fall{20, 0.01, 1e5}, Fall{100, 0.001, 1e6}})
    for (const double tilt : {0.0, 0.3}) {
      if (tilt > 0 && f.speed > 5) continue;  // it would turn by more than π in a step
      SCOPED_TRACE("at " + std::to_string(f.speed) + " m/s, turned by " + std::to_string(tilt));
      const Scene scene = plate_below(f.thickness, f.kn, {0.01, -0.02, 0.08});
      const Model model(scene);
      Batch batch(model, 1);
      std::vector<double> q = testing::q_of(batch), v(6, 0.0);
      q[3] = std::cos(tilt / 2), q[4] = 0.6 * std::sin(tilt / 2), q[5] = 0.8 * std::sin(tilt / 2);
      v[2] = -f.speed;
      batch.set_state(0, q, v);
      const double before = energy(scene, q, v);
      Stepper stepper(model, testing::options(Integrator::bdf1, 5e-3, 1e-9));
      for (int t = 0; t < 200; ++t) {
        stepper.step(batch, {});
        ASSERT_FALSE(failed(batch.status(0))) << "step " << t;
        q = testing::q_of(batch);
        ASSERT_GT(q[2] + 0.08, 0) << "step " << t;
        ASSERT_LE(energy(scene, q, testing::v_of(batch)), before * (1 + 1e-9)) << "step " << t;
      }
    }
}

/// A spring that is too soft to stop the box says so in the step in which it gives way.
TEST(FastBox, ThatPassesIsFlagged) {
  for (const Integrator scheme : integrators()) {
    SCOPED_TRACE(to_string(scheme));
    const Model model(plate_below(0.001, 100, {0.01, -0.02, 0.2}));
    Batch batch(model, 1);
    batch.set_state(0, testing::q_of(batch), std::vector<double>{0, 0, -100, 0, 0, 0});
    Stepper stepper(model, testing::options(scheme, 5e-3));
    int passed = 0;
    for (int t = 0; t < 20; ++t) {
      stepper.step(batch, {});
      passed += batch.status(0) == StepStatus::tunnelled;
    }
    EXPECT_LT(testing::q_of(batch)[2], -1);
    EXPECT_EQ(passed, 1);
  }
}

/// The second plate begins where the first ends. The box slides across.
TEST(Seam, ABoxSlidesAcross) {
  for (const double kn : {1e3, 1e5}) {
    SCOPED_TRACE(kn);
    Scene s = plate_below(0.02, kn, {-0.04, 0, kEdge / 2});
    s.links[0].joint.pose.position[0] = -0.15;
    s.links.push_back(link("next", JointType::fixed, {0.15, 0, -0.01}, box({0.3, 0.3, 0.02}), 1));
    s.pair_contacts[0].coefficients.mu = 0.01;
    s.pair_contacts.push_back(s.pair_contacts[0]);
    s.pair_contacts[1].primitive_body = "next";
    const Model model(s);
    Batch batch(model, 1);
    std::vector<double> v(6, 0.0);
    v[0] = 0.4;
    batch.set_state(0, testing::q_of(batch), v);
    Stepper stepper(model, testing::options(Integrator::bdf1, 2e-3, 1e-9));
    for (int t = 0; t < 150; ++t) stepper.step(batch, {});
    EXPECT_GT(testing::q_of(batch)[0], 0.1);
    EXPECT_NEAR(testing::q_of(batch)[2], 0, 5e-3);
  }
}

/// A plank that leans on a post reaches around it: no face of the post is between them.
TEST(Plank, LeansOnThePost) {
  Scene s;
  s.name = "plank";
  s.links = {
      link("post", JointType::fixed, {0, 0, 0.05}, box({0.01, 0.1, 0.1}), 1),
      link("plank", JointType::free, {0.00971, 0, 0.13215}, box({0.3, 0.04, 0.01}), kDensity)};
  const double lean = 1.0;  // [rad]
  s.links[1].body.shape = CuboidShape{{0.3, 0.04, 0.01}, {31, 5, 2}};
  touch(s, "plank", "post", 1e4, true);
  const Model model(s);
  Batch batch(model, 1);
  std::vector<double> q = testing::q_of(batch);
  q[3] = std::cos(lean / 2), q[5] = -std::sin(lean / 2);
  batch.set_state(0, q, std::vector<double>(6, 0.0));
  Stepper stepper(model, testing::options(Integrator::bdf1, 1e-3, 1e-9));
  double fastest = 0;
  for (int t = 0; t < 200; ++t) {
    stepper.step(batch, {});
    ASSERT_FALSE(failed(batch.status(0))) << "step " << t;
    const std::vector<double> v = testing::v_of(batch);
    fastest = std::max(fastest, std::hypot(v[0], v[1], v[2]));
  }
  EXPECT_LT(fastest, 3) << "[m/s]; it falls for 0.2 s";
}

/// The same bits in any lane, beside any neighbour.
TEST(FastBox, HasTheSameBitsInAnyLane) {
  const Scene scene = plate_below(0.01, 1e4);
  const Model model(scene);
  constexpr int kRuns = 11;
  const auto start = [&](int e, Batch& batch, int into) {
    std::vector<double> q = testing::q_of(batch), v(6, 0.0);
    q[0] += 0.013 * e, q[2] += 0.004 * e;
    v[2] = -0.7 * e, v[3] = 0.9 * e, v[4] = -0.4 * e;
    if (e == 6) v[2] = -1e6;
    batch.set_state(into, q, v);
  };
  const auto run = [&](Batch& batch) {
    Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3, 1e-9));
    for (int t = 0; t < 60; ++t) stepper.step(batch, {});
  };
  Batch all(model, kRuns);
  for (int e = 0; e < kRuns; ++e) start(e, all, e);
  run(all);
  for (int e = 0; e < kRuns; ++e) {
    if (e == 6) continue;
    Batch one(model, 1);
    start(e, one, 0);
    run(one);
    EXPECT_EQ(testing::q_of(one), testing::q_of(all, e)) << e;
    EXPECT_EQ(testing::v_of(one), testing::v_of(all, e)) << e;
  }
}

/// A turned box comes down at 3 m/s over a corner of the plate, so that some of its corners end
/// below the middle of the plate, where the nearest face would be the lower one, and some beside
/// it.
class Landing : public ::testing::TestWithParam<Integrator> {};

TEST_P(Landing, GradientsMatchDifferences) {
  const Scene scene = plate_below(0.01, 2e3, {0.13, 0.12, 0.035});
  const Model model(scene);
  const StepperOptions options = testing::options(GetParam(), 5e-3, 1e-13);
  constexpr int kSteps = 4;
  const Batch batch(model, 1);
  testing::RunInput in{testing::q_of(batch),
                       {0.1, -0.2, -3, 0.3, -0.4, 0.2},
                       std::vector<std::vector<double>>(kSteps)};
  in.q[3] = std::cos(0.1), in.q[4] = 0.6 * std::sin(0.1), in.q[6] = 0.8 * std::sin(0.1);
  const testing::StateLoss loss(model, kSteps, 5);
  const testing::RunGradient adjoint = testing::adjoint_of_run(model, options, {in}, loss, 0);
  const testing::RunGradient difference =
      testing::differences_of_run(model, options, in, loss, 1e-5);
  const auto compare = [](const std::vector<double>& a, const std::vector<double>& b,
                          const char* what) {
    double scale = 0;
    for (const double x : b) scale = std::max(scale, std::abs(x));
    EXPECT_GT(scale, 0) << what;
    for (std::size_t i = 0; i < a.size(); ++i)
      EXPECT_NEAR(a[i], b[i], 1e-6 * scale) << what << " " << i;
  };
  compare(adjoint.q, difference.q, "q");
  compare(adjoint.v, difference.v, "v");
  const NumberGradients numbers(model);
  std::vector<double> a, b;
  for (std::size_t k = 0; k < adjoint.parameters.size(); ++k) {
    if (!std::isfinite(difference.parameters[k])) continue;
    a.push_back(adjoint.parameters[k] * numbers.infos()[k].value);
    b.push_back(difference.parameters[k] * numbers.infos()[k].value);
  }
  compare(a, b, "numbers");
}

INSTANTIATE_TEST_SUITE_P(All, Landing,
                         ::testing::ValuesIn(integrators().begin(), integrators().end()));

}  // namespace
}  // namespace tangere
