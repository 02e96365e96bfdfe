// SPDX-License-Identifier: Apache-2.0
// Tests orders of convergence against solutions from another method: dense equations in world axes,
// extrapolated in long double.
#include <gtest/gtest.h>

#include "tests/engine/dense_dynamics.hpp"
#include "tests/engine/extrapolation.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;
using Long = long double;
using Dense = testing::DenseDynamics<Long>;

/// Bars that hang on each other by skew hinges.
Scene bars(int count, double damping) {
  Scene s;
  const Vector3 axes[] = {{0, 1, 0}, {0.6, 0.8, 0}, {0, 0.6, 0.8}};
  for (int i = 0; i < count; ++i) {
    const std::string name = "bar" + std::to_string(i);
    s.links.push_back(link(name, JointType::revolute, {i == 0 ? 0 : 0.2, 0, 0},
                           CuboidShape{{0.2, 0.04, 0.03}, {2, 2, 2}}, 900));
    LinkDescription& l = s.links.back();
    l.parent = i - 1;
    l.joint.axis0 = axes[i % 3];
    l.joint.damping = damping;
    l.body.pose.position = {0.1, 0, 0};
    s.initial.push_back({l.joint.name, {0.3 - 0.1 * i}, {i % 2 == 0 ? 1.0 : -1.5}, {}});
  }
  return s;
}

Scene pendulum() { return bars(4, 0); }

/// Seven damped joints with springs and rotors; a motor drives one of them to a target.
Scene arm() {
  Scene s = bars(7, 0.02);
  for (std::size_t i = 0; i < 7; ++i) {
    s.links[i].joint.stiffness = 1 + 0.3 * double(i);
    s.links[i].joint.rest = {0.1 * double(i) - 0.2};
    s.links[i].joint.armature = 0.002;
  }
  s.motors.push_back({"bar2_joint", -HUGE_VAL, HUGE_VAL, {}, MotorControl::position, 3, 0.05});
  return s;
}

/// Ball joints with a spring, limits that push all the time, and a motor that turns one of them.
Scene balls() {
  Scene s = bars(3, 0.003);
  s.initial.clear();
  for (LinkDescription& l : s.links) l.joint.type = JointType::spherical;
  s.links[0].joint.stiffness = 0.5;
  s.links[0].joint.rest = {0.2, -0.3, 0.4};
  s.links[1].joint.limit_stiffness = 0.02;
  s.links[1].joint.limits = {-3,
                             -2.5};  // no component ever gets there: a kink would cost the order
  s.initial.push_back({"bar0_joint", {}, {1, 2, -1}, {}});
  s.initial.push_back({"bar1_joint", {0.8, 0.36, 0.48, 0}, {0.5, 0.4, 0.3}, {}});
  s.motors.push_back({"bar2_joint", -HUGE_VAL, HUGE_VAL, {}, MotorControl::position, 0.1, 0.002});
  return s;
}

/// Two roots and branches: planar and free2d trunks, a slide, a massless cross slide, a fixed
/// plate.
Scene branches() {
  Scene s;
  const CuboidShape box{{0.1, 0.06, 0.04}, {2, 2, 2}};
  const auto add = [&](const char* name, int parent, JointType type,
                       Vector3 at) -> LinkDescription& {
    s.links.push_back(link(name, type, at, box, 800));
    s.links.back().parent = parent;
    s.links.back().body.pose = {{0.04, 0.01, -0.02}, {0.8, 0, 0.6, 0}};
    return s.links.back();
  };
  LinkDescription& trunk = add("trunk", -1, JointType::planar, {0, 0, 0});
  trunk.joint.axis0 = {0.6, 0, 0.8}, trunk.joint.axis1 = {0, 1, 0};
  trunk.joint.stiffness = 30;
  add("left", 0, JointType::revolute, {0.1, 0, 0}).joint.axis0 = {0, 0.6, 0.8};
  add("right", 0, JointType::spherical, {-0.1, 0, 0}).joint.damping = 0.01;
  add("plate", 2, JointType::fixed, {0, 0.1, 0});
  LinkDescription& cross = add("cross", 1, JointType::prismatic, {0, 0, 0.1});
  cross.body.density = 0;
  cross.joint.stiffness = 40;
  LinkDescription& tip = add("tip", 4, JointType::prismatic, {0, 0, 0});
  tip.joint.axis0 = {1, 0, 0};
  tip.joint.stiffness = 50;
  tip.joint.armature = 0.05;
  add("disc", -1, JointType::free2d, {0, 0, 1}).joint.turning = JointEffects{0.001, 0, 0.05, 0, {}};
  add("leaf", 6, JointType::translational, {0.1, 0, 0}).joint.stiffness = 60;
  s.initial.push_back({"left_joint", {0.4}, {3}, {}});
  s.initial.push_back({"right_joint", {}, {2, -1, 4}, {}});
  s.initial.push_back({"tip_joint", {0.02}, {0.1}, {}});
  s.initial.push_back({"disc_joint", {0, 0, 0.5}, {0.3, -0.2, 5}, {}});
  s.initial.push_back({"leaf_joint", {0.01, 0, -0.02}, {0, 0.3, 0}, {}});
  return s;
}

/// A free body with three different moments of inertia that turns about the middle one, so it
/// flips.
Scene tumbling() {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {
      link("body", JointType::free, {0, 0, 0}, CuboidShape{{0.3, 0.2, 0.1}, {2, 2, 2}}, 500)};
  s.links[0].body.pose = {{0.02, -0.01, 0.03}, {0.8, 0.6, 0, 0}};
  s.initial.push_back({"body_joint", {}, {0.1, 0.2, 0, 0.2, 1.5, 4.8}, {}});
  return s;
}

struct Case {
  const char* name;
  Scene (*scene)();
  double duration;
  int steps;  ///< of the first-order schemes' coarse run
};

/// Returns (q, v) of the dense equations after a time, with quaternions of unit length.
Dense::Vector reference(const Scene& scene, const std::vector<double>& u, double duration,
                        int steps) {
  const Dense dense(scene);
  Dense::Vector y(dense.nq + dense.nv);
  y << dense.initial_q(), dense.initial_v();
  const auto slope = [&](const Dense::Vector& at) {
    const Dense::Vector q = at.head(dense.nq), v = at.tail(dense.nv);
    Dense::Vector out(at.size());
    out << dense.rate(q, v), dense.acceleration(q, v, u);
    return out;
  };
  return testing::extrapolate(slope, y, Long(duration), steps);
}

struct Errors {
  double q, v;
};

/// Distance to the reference in q and v. The sign of a quaternion does not matter.
Errors errors(const Model& model, Integrator scheme, const std::vector<double>& u, double duration,
              int steps, const Dense::Vector& exact) {
  Stepper stepper(model, testing::options(scheme, duration / steps, 1e-13));
  Batch batch(model, 1);
  for (int k = 0; k < steps; ++k) stepper.step(batch, u);
  EXPECT_FALSE(failed(batch.status(0))) << to_string(batch.status(0));
  const std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
  Errors e{0, 0};
  std::size_t i = 0;
  const auto add = [&](double sign) {
    e.q += std::pow(q[i] - sign * double(exact[int(i)]), 2), ++i;
  };
  for (const LinkDescription& l : model.scene().links) {
    const bool ball = l.joint.type == JointType::spherical || l.joint.type == JointType::free;
    for (int k = 0; k < position_count(l.joint.type) - (ball ? 4 : 0); ++k) add(1);
    if (!ball) continue;
    double match = 0;
    for (std::size_t k = 0; k < 4; ++k) match += q[i + k] * double(exact[int(i + k)]);
    for (int k = 0; k < 4; ++k) add(match < 0 ? -1 : 1);
  }
  for (std::size_t k = 0; k < v.size(); ++k)
    e.v += std::pow(v[k] - double(exact[int(q.size() + k)]), 2);
  return {std::sqrt(e.q), std::sqrt(e.v)};
}

class JointConvergence : public ::testing::TestWithParam<Case> {};

TEST_P(JointConvergence, SchemesReachTheIndependentSolutionWithTheirOrder) {
  const Case& c = GetParam();
  const Model model(c.scene());
  std::vector<double> u(std::size_t(model.nu()), 0.2);
  const Dense::Vector exact = reference(model.scene(), u, c.duration, 80);
  const double uncertainty = double((exact - reference(model.scene(), u, c.duration, 100)).norm());
  ASSERT_LT(uncertainty, 1e-11) << "the reference itself has not converged";
  const struct {
    Integrator scheme;
    double order, slack;
    int steps;
  } kSchemes[] = {{Integrator::bdf1, 1, 0.1, c.steps},
                  {Integrator::bdf2, 2, 0.15, c.steps / 2},
                  {Integrator::sdirk2, 2, 0.15, c.steps / 4}};
  for (const auto& s : kSchemes) {
    const Errors coarse = errors(model, s.scheme, u, c.duration, s.steps, exact);
    const Errors fine = errors(model, s.scheme, u, c.duration, 2 * s.steps, exact);
    EXPECT_NEAR(std::log2(coarse.q / fine.q), s.order, s.slack)
        << to_string(s.scheme) << ", error " << fine.q;
    EXPECT_NEAR(std::log2(coarse.v / fine.v), s.order, s.slack)
        << to_string(s.scheme) << ", error " << fine.v;
    // Errors are as small as those of a finer step, so the solution is the right one.
    EXPECT_LT(fine.q, s.order == 1 ? 0.05 : 2e-3) << to_string(s.scheme);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, JointConvergence,
                         ::testing::Values(Case{"pendulum", pendulum, 0.5, 1600},
                                           Case{"arm", arm, 0.4, 1600},
                                           Case{"balls", balls, 0.3, 1600},
                                           Case{"branches", branches, 0.4, 4800},
                                           Case{"tumbling", tumbling, 1.5, 3200}),
                         [](const auto& param) { return std::string(param.param.name); });

TEST(JointConvergence, TheMiddleAxisFlipsAndAngularMomentumStays) {
  const Scene scene = tumbling();
  const Model model(scene);
  const Dense dense(scene);
  const auto terms = [&](const Batch& b) {
    const std::vector<double> q = testing::q_of(b), v = testing::v_of(b);
    return dense.terms(Eigen::Map<const Eigen::VectorXd>(q.data(), 7).cast<Long>(),
                       Eigen::Map<const Eigen::VectorXd>(v.data(), 6).cast<Long>(), {});
  };
  const auto run = [&](int steps) {
    Stepper stepper(model, testing::options(Integrator::sdirk2, 8.0 / steps, 1e-12));
    Batch batch(model, 1);
    const auto start = terms(batch);
    double lost = 0;
    int flips = 0;
    bool forward = true;
    for (int k = 0; k < steps; ++k) {
      stepper.step(batch, {});
      const auto now = terms(batch);
      lost = std::max(lost, double((now.angular_momentum - start.angular_momentum).norm() /
                                   start.angular_momentum.norm()));
      const double middle = testing::v_of(batch)[4] * 0.28 +
                            testing::v_of(batch)[5] * 0.96;  // about the body's own y
      if ((middle > 0) != forward) ++flips, forward = !forward;
    }
    EXPECT_NEAR(double(terms(batch).energy / start.energy), 1, 0.02);
    return std::pair{lost, flips};
  };
  const auto [coarse, few] = run(4000);
  const auto [fine, flips] = run(8000);
  EXPECT_GE(flips, 2);
  EXPECT_LT(fine, 1e-3);
  EXPECT_GT(coarse / fine, 3);  // it is lost like h² or faster
}

}  // namespace
}  // namespace tangere
