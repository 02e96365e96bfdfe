// SPDX-License-Identifier: Apache-2.0
// Tests that exactly at a kink a derivative is finite and belongs to one side, where a one-sided
// difference agrees. At the first touch it is the side without contact, on the bound of friction
// that of sticking, at a limit and at a clip the inside.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/engine/gradient_run.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using testing::RunGradient;
using testing::RunInput;
using testing::StateLoss;

constexpr double kStep = 5e-3;

/// A ball that slides on the ground, with dofs x, y, z and pushes of up to 10 N, without gravity.
Scene ball_on_ground() {
  Scene s;
  s.name = "ball_on_ground";
  s.timestep = kStep;
  s.gravity = {0, 0, 0};
  s.solver.bounded_energy = false;  // a step that is taken again is a jump, not a kink
  s.ground = GroundDescription{};
  s.links = {link("ball", JointType::translational, {0, 0, 0.5}, SphereShape{0.5}, 2)};
  s.motors.push_back({"ball_joint", -10, 10, {}});
  s.ground_contacts.push_back({"ball", {1e3, 5, 0.5, 3}, ContactLaw::linear, 1e-5, {}});
  return s;
}

struct Case {
  Model model;
  StepperOptions options;
  RunInput in;
  StateLoss loss;

  Case(const Scene& scene, Integrator scheme, int steps)
      : model(scene),
        options(testing::options(scheme, scene.timestep, 1e-13)),
        loss(model, steps, 3) {
    const Batch batch(model, 1);
    in.q = testing::q_of(batch);
    in.v.assign(std::size_t(model.nv()), 0.0);
    in.u.assign(std::size_t(steps), std::vector<double>(std::size_t(model.nu())));
  }
  [[nodiscard]] RunGradient adjoint() const {
    return testing::adjoint_of_run(model, options, {in}, loss, 0);
  }

  /// Derivative towards one side, of second order. `change`(input, e) moves the input by e.
  template <class Change>
  [[nodiscard]] double towards(double side, const Change& change) const {
    const auto at = [&](double e) {
      RunInput moved = in;
      if (e != 0) change(moved, e);
      return testing::loss_of_run(model, options, moved, loss);
    };
    const double e = 1e-5 * side;
    return (-3 * at(0) + 4 * at(e) - at(2 * e)) / (2 * e);
  }
};

void expect_side(double derivative, double right, double other) {
  EXPECT_TRUE(std::isfinite(derivative));
  const double tolerance = 1e-6 * (1 + std::abs(right));
  EXPECT_NEAR(derivative, right, tolerance);
  EXPECT_GT(std::abs(right - other), 10 * tolerance) << "no kink here";
}

class Kinks : public ::testing::TestWithParam<Integrator> {};

TEST_P(Kinks, TheFirstTouchIsThatOfNoContact) {
  const Case c(ball_on_ground(), GetParam(), 4);
  const RunGradient g = c.adjoint();
  const auto q = [](RunInput& x, double e) { x.q[2] += e; };
  const auto v = [](RunInput& x, double e) { x.v[2] += e; };
  const auto u = [](RunInput& x, double e) { x.u[0][2] += e; };
  expect_side(g.q[2], c.towards(1, q), c.towards(-1, q));
  expect_side(g.v[2], c.towards(1, v), c.towards(-1, v));
  expect_side(g.u[2], c.towards(1, u), c.towards(-1, u));
}

TEST_P(Kinks, AtALimitItIsThatOfTheInside) {
  Scene s;
  s.name = "slider";
  s.timestep = kStep;
  s.gravity = {0, 0, 0};
  s.solver.bounded_energy = false;
  s.links = {link("slider", JointType::prismatic, {0, 0, 0},
                  CuboidShape{{0.1, 0.1, 0.1}, {2, 2, 2}}, 1000)};
  s.links[0].joint.limits = {{0, 1}};
  s.links[0].joint.limit_stiffness = 1e4;
  s.motors.push_back({"slider_joint", -10, 10, {}});
  for (const double end : {0.0, 1.0}) {
    Case c(s, GetParam(), 4);
    c.in.q[0] = end;
    const double inside = end == 0 ? 1 : -1;
    const RunGradient g = c.adjoint();
    const auto q = [](RunInput& x, double e) { x.q[0] += e; };
    const auto v = [](RunInput& x, double e) { x.v[0] += e; };
    const auto u = [](RunInput& x, double e) { x.u[1][0] += e; };
    expect_side(g.q[0], c.towards(inside, q), c.towards(-inside, q));
    expect_side(g.v[0], c.towards(inside, v), c.towards(-inside, v));
    expect_side(g.u[1], c.towards(inside, u), c.towards(-inside, u));
  }
}

TEST_P(Kinks, AtAClipItIsThatOfTheInside) {
  Case c(ball_on_ground(), GetParam(), 4);
  c.in.q[2] = 0.1;  // in the air
  c.in.u[1] = {1, -1, 0.5};
  const RunGradient g = c.adjoint();
  for (std::size_t k = 0; k < 2; ++k) {
    const double inside = k == 0 ? -1 : 1;
    const auto u = [k](RunInput& x, double e) { x.u[1][k] += e; };
    expect_side(g.u[3 + k], c.towards(inside, u), c.towards(-inside, u));
    EXPECT_NEAR(c.towards(-inside, u), 0, 1e-9);
  }
}

/// Finds the push at which the ball begins to slip, to the last bit: the largest push at which it
/// sticks, and the next number.
TEST_P(Kinks, BetweenStickAndSlipItIsThatOfEitherSide) {
  Scene s = ball_on_ground();
  s.gravity = {0, 0, -9.8};
  s.ground_contacts[0].coefficients.kt = 1e3;
  Case c(s, GetParam(), 3);
  c.in.q[2] = -9.8 * 2 * 4 / 3 * 3.14159265358979 * 0.125 / 1e3;  // where it rests
  const auto slope = [&](double push) {
    c.in.u[0][0] = push;
    return c.adjoint().u[0];
  };
  const double sticks = slope(0.0);
  double low = 0, high = 1;
  ASSERT_GT(std::abs(slope(high) - sticks), 1e-3 * std::abs(sticks));
  for (int i = 0; i < 200 && std::nextafter(low, high) < high; ++i) {
    const double middle = 0.5 * (low + high);
    (std::abs(slope(middle) - sticks) < 1e-7 * std::abs(sticks) ? low : high) = middle;
  }
  const auto u = [](RunInput& x, double e) { x.u[0][0] += e; };
  const double before = slope(low);
  expect_side(before, c.towards(-1, u), c.towards(1, u));
  const double after = slope(high);
  expect_side(after, c.towards(1, u), c.towards(-1, u));
}

INSTANTIATE_TEST_SUITE_P(Schemes, Kinks, ::testing::Values(Integrator::bdf1, Integrator::bdf2),
                         [](const auto& given) { return std::string(to_string(given.param)); });

}  // namespace
}  // namespace tangere
