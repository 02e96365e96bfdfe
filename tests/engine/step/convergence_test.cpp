// SPDX-License-Identifier: Apache-2.0
// Tests the order of convergence of every scheme on smooth motion, in q and in v.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;

/// A free body with its centre of mass off its frame, tumbling under gravity.
Scene tumbling() {
  Scene s;
  s.links = {
      link("body", JointType::free, {0, 0, 0}, CuboidShape{{0.1, 0.05, 0.02}, {2, 2, 2}}, 700)};
  s.links[0].body.pose = {{0.03, -0.02, 0.01}, {0.8, 0.6, 0, 0}};
  s.initial.push_back({"body_joint", {}, {0.1, 0.2, -0.1, 4, 7, -3}, {}});
  return s;
}

/// Three links on skew hinges.
Scene chain() {
  Scene s;
  const Vector3 axes[] = {{0, 1, 0}, {0.6, 0.8, 0}, {0, 0.6, 0.8}};
  for (int i = 0; i < 3; ++i) {
    s.links.push_back(link("l" + std::to_string(i), JointType::revolute, {i == 0 ? 0 : 0.2, 0, 0},
                           CuboidShape{{0.2, 0.04, 0.03}, {2, 2, 2}}, 900));
    s.links.back().parent = i - 1;
    s.links.back().joint.axis0 = axes[i];
    s.links.back().joint.damping = 0.002;
    s.links.back().body.pose.position = {0.1, 0, 0};
  }
  s.initial.push_back({"l1_joint", {0.5}, {2}, {}});
  return s;
}

/// A ball joint at the end of a slide: translational products and a quaternion state.
Scene ball_chain() {
  Scene s;
  s.links = {link("slide", JointType::prismatic, {0, 0, 0}, SphereShape{0.05}, 800),
             link("arm", JointType::spherical, {0, 0, -0.05},
                  CuboidShape{{0.03, 0.05, 0.2}, {2, 2, 2}}, 900)};
  s.links[0].joint.axis0 = {1, 0, 0};
  s.links[1].parent = 0;
  s.links[1].body.pose.position = {0, 0, -0.1};
  s.initial.push_back({"arm_joint", {}, {3, 1, 2}, {}});
  return s;
}

/// A sphere sinking into the ground near its balance: it never leaves, so the motion is smooth.
Scene resting() {
  Scene s;
  s.ground = GroundDescription{};
  s.links = {link("ball", JointType::translational, {0, 0, 0.05}, SphereShape{0.05}, 1000)};
  s.ground_contacts.push_back({"ball", {2000, 0.5, 10, 3}, ContactLaw::clamped, 1e-5, {}});
  s.initial.push_back({"ball_joint", {0, 0, -0.003}, {0.02, 0, 0}, {}});
  return s;
}

struct State {
  std::vector<double> q, v;
};

State run(const Model& model, Integrator scheme, double duration, int steps) {
  Stepper stepper(model, testing::options(scheme, duration / steps, 1e-13));
  Batch batch(model, 1);
  const std::vector<double> none(std::size_t(model.nu()), 0.0);
  for (int k = 0; k < steps; ++k) stepper.step(batch, none);
  EXPECT_FALSE(failed(batch.status(0))) << to_string(batch.status(0));
  return {testing::q_of(batch), testing::v_of(batch)};
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

struct Case {
  const char* name;
  Scene (*scene)();
  double duration;
  int few;  ///< steps that show order 3: errors of higher orders soon drown in rounding
};

class Convergence : public ::testing::TestWithParam<Case> {};

TEST_P(Convergence, SchemesHaveTheirOrder) {
  const Case& c = GetParam();
  const Model model(c.scene());
  const State exact = run(model, Integrator::sdirk4, c.duration, 800);
  const struct {
    double slack;
    int steps;
  } kByOrder[] = {{0.1, 400}, {0.15, 400}, {0.25, c.few}, {0.7, c.few / 4}};
  for (const Integrator integrator : testing::all_integrators()) {
    const int order = integrator.scheme().order;
    const auto& s = kByOrder[order - 1];
    const State coarse = run(model, integrator, c.duration, s.steps),
                fine = run(model, integrator, c.duration, 2 * s.steps);
    const double q_order = std::log2(distance(coarse.q, exact.q) / distance(fine.q, exact.q));
    const double v_order = std::log2(distance(coarse.v, exact.v) / distance(fine.v, exact.v));
    EXPECT_NEAR(q_order, order, s.slack)
        << to_string(integrator) << ", error " << distance(fine.q, exact.q);
    EXPECT_NEAR(v_order, order, s.slack)
        << to_string(integrator) << ", error " << distance(fine.v, exact.v);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, Convergence,
                         ::testing::Values(Case{"tumbling", tumbling, 0.4, 100},
                                           Case{"chain", chain, 0.4, 100},
                                           Case{"ball_chain", ball_chain, 0.4, 100},
                                           Case{"resting", resting, 0.1, 400}),
                         [](const auto& param) { return std::string(param.param.name); });

TEST(Convergence, ASplitInsideBdf2KeepsOrderTwo) {
  // Replaces some steps by two half steps of SDIRK2, as a split does. The history at the grid
  // points stays valid.
  const Model model(tumbling());
  const double duration = 0.4;
  const State exact = run(model, Integrator::sdirk2, duration, 6400);
  const auto mixed = [&](int steps) {
    const double h = duration / steps;
    Stepper bdf(model, testing::options(Integrator::bdf2, h, 1e-13));
    Stepper half(model, testing::options(Integrator::sdirk2, 0.5 * h, 1e-13));
    Batch batch(model, 1);
    for (int k = 0; k < steps; ++k) {
      if (k % 7 != 3) {
        bdf.step(batch, {});
        continue;
      }
      const std::vector<double> q0 = testing::q_of(batch), v0 = testing::v_of(batch);
      half.step(batch, {});
      half.step(batch, {});
      const std::vector<double> q1 = testing::q_of(batch), v1 = testing::v_of(batch);
      batch.set_state(0, q1, v1, q0, v0);
    }
    return distance(testing::q_of(batch), exact.q);
  };
  EXPECT_NEAR(std::log2(mixed(200) / mixed(400)), 2, 0.15);
}

}  // namespace
}  // namespace tangere
