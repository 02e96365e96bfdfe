// SPDX-License-Identifier: Apache-2.0
// Tests joints that follow others: they stay where their leaders put them, move as the same
// mechanism with one coordinate does, and gradients agree by three routes.
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "tests/engine/effect_properties.hpp"
#include "tests/engine/gradient_differences.hpp"
#include "tests/engine/gradient_tangent.hpp"
#include "tests/engine/random_followers.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::link;

/// Two masses on rails of one direction. The second follows the first: q₂ = -2 q₁ + 0.1 m.
Scene two_rails() {
  Scene s;
  s.name = "two rails";
  s.gravity = {0, 0, 0};
  const Shape box = CuboidShape{{0.1, 0.1, 0.1}, {2, 2, 2}};
  s.links = {link("first", JointType::prismatic, {}, box, 1000),
             link("second", JointType::prismatic, {0, 1, 0}, box, 500)};
  for (LinkDescription& l : s.links) l.joint.axis0 = {1, 0, 0};
  JointDescription& second = s.links[1].joint;
  second.follows = {"first_joint"};
  second.ratio = {-2};
  second.offset = 0.1;
  s.motors.push_back({"first_joint", -10, 10, {}});
  s.motors.push_back({"second_joint", -10, 10, {}});
  return s;
}

/// A force of 3 N on the first and 0.5 N on the second accelerate 1 + 4 · 0.5 kg by 3 - 2 · 0.5 N.
TEST(Followers, MoveAsOneMassWouldByClosedForm) {
  const Model model(two_rails());
  Batch batch(model, 1);
  EXPECT_EQ(testing::q_of(batch), (std::vector<double>{0, 0.1}));
  Stepper stepper(model, testing::options(Integrator::sdirk2, 1e-2));
  for (int t = 0; t < 100; ++t) stepper.step(batch, std::vector<double>{0.3, 0.05});
  const double a = (3 - 2 * 0.5) / (1 + 4 * 0.5);
  const std::vector<double> q = testing::q_of(batch), v = testing::v_of(batch);
  EXPECT_NEAR(q[0], 0.5 * a, 1e-12);
  EXPECT_NEAR(v[0], a, 1e-12);
  EXPECT_EQ(q[1], -2 * q[0] + 0.1);
  EXPECT_EQ(v[1], -2 * v[0]);
}

/// A scheme, and the share of followers that follow by a polynomial.
using FollowerCase = std::tuple<Integrator, double>;
class FollowersBySchemes : public ::testing::TestWithParam<FollowerCase> {
 protected:
  static Integrator scheme() { return std::get<0>(GetParam()); }
  static Scene machine(unsigned seed, int links) {
    return testing::following_machine(seed, links, std::get<1>(GetParam()));
  }
};

TEST_P(FollowersBySchemes, KeepTheirPlacesInRandomMachines) {
  int followers = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    const Model model(machine(seed, 3 + static_cast<int>(seed % 5)));
    followers += testing::count_followers(model.scene());
    testing::RunInput in = testing::following_input(model, seed, 300);
    Batch batch(model, 11);
    Stepper stepper(model, testing::options(scheme(), 2e-3));
    for (int e = 0; e < 11; ++e) batch.set_state(e, in.q, in.v);
    for (const auto& u : in.u) testing::step_all(stepper, batch, u);
    for (int e = 0; e < 11; ++e) {
      if (failed(batch.status(e))) continue;
      testing::RunInput end;
      end.q = testing::q_of(batch, e), end.v = testing::v_of(batch, e);
      testing::RunInput placed = end;
      testing::place_followers(model.scene(), placed);
      for (std::size_t k = 0; k < end.q.size(); ++k)
        EXPECT_NEAR(end.q[k], placed.q[k], 1e-12 * (1 + std::abs(end.q[k])));
      for (std::size_t k = 0; k < end.v.size(); ++k)
        EXPECT_NEAR(end.v[k], placed.v[k], 1e-12 * (1 + std::abs(end.v[k])));
      EXPECT_EQ(testing::q_of(batch, e), testing::q_of(batch, 0));
    }
  }
  EXPECT_GT(followers, 8);
}

/// Whether some step of a run is not found at once: differences across a split are no derivative.
bool splits(const Model& model, const StepperOptions& options, const testing::RunInput& in) {
  Batch batch(model, 1);
  batch.set_state(0, in.q, in.v);
  Stepper stepper(model, options);
  for (const auto& u : in.u) {
    stepper.step(batch, u);
    if (batch.status(0) != StepStatus::converged) return true;
  }
  return false;
}

/// Six steps against differences along the coordinates that are free, and against tangents.
TEST_P(FollowersBySchemes, GradientsMatchDifferences) {
  constexpr int kFollowedSteps = 6;
  int compared = 0;
  for (unsigned seed = 1; seed <= (std::get<1>(GetParam()) > 0 ? 3 : 8); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Model model =
        testing::without_second_looks(machine(seed, 3 + static_cast<int>(seed % 4)));
    if (testing::count_followers(model.scene()) == 0) continue;
    const StepperOptions options = testing::options(scheme(), model.timestep(), 1e-13);
    const testing::RunInput in = testing::following_input(model, seed, kFollowedSteps);
    const testing::StateLoss loss(model, kFollowedSteps, seed + 1);
    if (splits(model, options, in)) continue;
    const testing::RunGradient adjoint = testing::adjoint_of_run(model, options, {in}, loss, 0);
    const testing::RunGradient difference = testing::differences_of_run(
        model, options, in, loss, 1e-3,
        [&](testing::RunInput& x) { testing::place_followers(model.scene(), x); });
    compared += testing::compare(adjoint.q, difference.q, testing::norm(difference.q), 1e-6, "q");
    compared += testing::compare(adjoint.v, difference.v, testing::norm(difference.v), 1e-6, "v");
    compared += testing::compare(adjoint.u, difference.u, testing::norm(difference.u), 1e-6, "u");
    std::vector<double> a = adjoint.parameters, b = difference.parameters;
    const NumberGradients parameters(model);
    for (std::size_t k = 0; k < a.size(); ++k) {
      const double size = testing::size_of(parameters.infos()[k]);
      a[k] *= size, b[k] *= size;
    }
    for (std::size_t k = 0; k < a.size(); ++k) {
      if (!std::isfinite(b[k])) continue;
      EXPECT_NEAR(a[k], b[k], 1e-6 * testing::norm(b)) << parameters.infos()[k].name;
      ++compared;
    }
  }
  EXPECT_GT(compared, std::get<1>(GetParam()) > 0 ? 40 : 60);
}

TEST_P(FollowersBySchemes, GradientsMatchTangents) {
  int compared = 0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Model model(machine(seed, 3 + static_cast<int>(seed % 4)));
    if (testing::count_followers(model.scene()) > 0)
      compared += testing::check_tangent(model, testing::options(scheme(), model.timestep(), 1e-13),
                                         testing::following_input(model, seed, 6), seed);
  }
  EXPECT_GE(compared, 4);
}

INSTANTIATE_TEST_SUITE_P(Schemes, FollowersBySchemes,
                         ::testing::Combine(::testing::Values(Integrator::bdf1, Integrator::bdf2,
                                                              Integrator::sdirk2,
                                                              Integrator::sdirk3),
                                            ::testing::Values(0.0, 0.7)));

/// By the start: the derivative along a leader is that of both, and along rates, too.
TEST(FollowersGradient, ByTheStartIsThatOfLeaderAndFollower) {
  Scene scene = two_rails();
  scene.links[0].joint.stiffness = 30;
  scene.links[1].joint.damping = 2;
  const Model model(scene);
  const StepperOptions options = testing::options(Integrator::bdf2, 1e-2, 1e-13);
  testing::RunInput in;
  in.q = {0.03, -2 * 0.03 + 0.1};
  in.v = {0.2, -0.4};
  for (int t = 0; t < 7; ++t) in.u.push_back({0.1, -0.2});
  const testing::StateLoss loss(model, 7, 3);
  const testing::RunGradient adjoint = testing::adjoint_of_run(model, options, {in}, loss, 0);
  const auto along = [&](double q, double v) {
    return testing::best_difference(
        [&](double e) {
          testing::RunInput other = in;
          other.q[0] += e * q, other.q[1] -= 2 * e * q;
          other.v[0] += e * v, other.v[1] -= 2 * e * v;
          return testing::loss_of_run(model, options, other, loss);
        },
        1e-5);
  };
  const double dq = along(1, 0), dv = along(0, 1);
  EXPECT_NEAR(adjoint.q[0], dq, 1e-7 * (1 + std::abs(dq)));
  EXPECT_NEAR(adjoint.v[0], dv, 1e-7 * (1 + std::abs(dv)));
  EXPECT_EQ(adjoint.q[1], 0);
}

/// A joint without mass that follows two is a tendon: its spring, damping and motor act on both.
/// With ℓ = 2 q₁ + q₂ and a spring k, masses m₁ and m₂ oscillate along (2/m₁, 1/m₂) with
/// ω² = k (4/m₁ + 1/m₂), and ℓ(t) = ℓ₀ cos ω t.
TEST(Tendon, SwingsByClosedForm) {
  Scene s = two_rails();
  s.links[1].joint.follows.clear();
  s.links[1].joint.ratio.clear();
  s.motors.clear();
  LinkDescription tendon = link("tendon", JointType::prismatic, {0, 3, 0}, SphereShape{1e-3}, 0);
  tendon.joint.follows = {"first_joint", "second_joint"};
  tendon.joint.ratio = {2, 1};
  tendon.joint.stiffness = 20;
  s.links.push_back(tendon);
  s.motors.push_back({"tendon_joint", -10, 10, {}});
  const Model model(s);
  Batch batch(model, 1);
  batch.set_state(0, std::vector<double>{0.01, 0.03, 0.05}, std::vector<double>{0, 0, 0});
  Stepper stepper(model, testing::options(Integrator::sdirk3, 1e-3));
  const double omega = std::sqrt(20 * (4 / 1.0 + 1 / 0.5));
  for (int t = 0; t < 500; ++t) stepper.step(batch, std::vector<double>{0});
  const std::vector<double> q = testing::q_of(batch);
  EXPECT_NEAR(q[2], 0.05 * std::cos(0.5 * omega), 1e-7);
  EXPECT_EQ(q[2], 2 * q[0] + q[1]);
  EXPECT_NEAR(q[0] - 0.01, 1 * (q[1] - 0.03), 1e-12) << "both are moved as 2/m1 and 1/m2";
  // At the load of its motor, the tendon's length is force over stiffness.
  s.links[2].joint.damping = 20;
  const Model held(s);
  Batch loaded(held, 1);
  Stepper settle(held, testing::options(Integrator::bdf1, 1e-2));
  for (int t = 0; t < 3000; ++t) settle.step(loaded, std::vector<double>{0.1});
  EXPECT_NEAR(testing::q_of(loaded)[2], 1.0 / 20, 1e-9);
}

TEST(FollowersFaults, SayWhatWasExpected) {
  const auto fault = [](const auto& change) {
    return testing::fault_of_model(two_rails(), change);
  };
  EXPECT_NE(fault([](Scene& s) { s.links[1].joint.follows = {"third"}; }).find("third"),
            std::string::npos);
  EXPECT_NE(fault([](Scene& s) {
              s.links[0].joint.follows = {"second_joint"}, s.links[0].joint.ratio = {1};
            }).find("no circle"),
            std::string::npos);
  EXPECT_NE(fault([](Scene& s) {
              s.links[0].joint.type = JointType::free;
              s.motors.clear();
            }).find("6 degrees of freedom"),
            std::string::npos);
  EXPECT_NE(fault([](Scene& s) {
              s.initial.push_back({"second_joint", {0.3}, {}, {}});
            }).find("no start of its own"),
            std::string::npos);
  Scene sleeping = two_rails();
  sleeping.solver.sleep = 1e-3;
  try {
    const Stepper stepper{Model(sleeping)};
    ADD_FAILURE() << "bodies do not sleep here";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("joints that follow others"), std::string::npos);
  }
  Batch batch(Model(two_rails()), 1);
  EXPECT_THROW(batch.set_state(0, std::vector<double>{0, 0}, std::vector<double>{0, 0}),
               InputError);
}

}  // namespace
}  // namespace tangere
