// SPDX-License-Identifier: Apache-2.0
// Tests positions, velocities and Jacobians of end effectors against closed forms, differences and
// motion.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "tests/engine/random_scene.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using kernels::Vec3;
using testing::link;
using testing::Random;

EndEffectorDescription effector(const std::string& name, const std::string& joint, Vector3 at) {
  EndEffectorDescription d;
  d.name = name;
  d.joint = joint;
  d.position = at;
  return d;
}

struct Reading {
  std::vector<double> position, velocity, jacobian;  // (n, 3), (n, 3), (n, 3, nv)
};
Reading read(Readout& readout, const Batch& batch, int environment = 0) {
  const std::size_t n = 3 * batch.model().end_effectors().size();
  Reading r{std::vector<double>(n), std::vector<double>(n),
            std::vector<double>(n * std::size_t(batch.model().nv()), std::nan(""))};
  readout.end_effectors(batch, environment, r.position, r.velocity);
  readout.end_effector_jacobian(batch, environment, r.jacobian);
  return r;
}
Reading read(const Model& model, const std::vector<double>& q, const std::vector<double>& v) {
  Batch batch(model, 1);
  batch.set_state(0, q, v);
  Readout readout(model);
  return read(readout, batch);
}

void expect_near(const std::vector<double>& found, const std::vector<double>& expected,
                 double tolerance, const std::string& what) {
  ASSERT_EQ(found.size(), expected.size()) << what;
  for (std::size_t k = 0; k < found.size(); ++k)
    EXPECT_NEAR(found[k], expected[k], tolerance) << what << "[" << k << "]";
}

TEST(EndEffectors, OfARevoluteChainAreThoseOfTheDrawing) {
  // Two arms in the plane z = 0.3, the second on a fixed joint that is turned by a quarter about z.
  Scene s;
  const CuboidShape box{{0.02, 0.02, 0.02}, {2, 2, 2}};
  s.links = {link("upper", JointType::revolute, {0.1, 0.2, 0.3}, box, 1000),
             link("bracket", JointType::fixed, {0.5, 0, 0}, box, 1000),
             link("lower", JointType::revolute, {0, -0.4, 0}, box, 1000)};
  s.links[1].parent = 0;
  s.links[2].parent = 1;
  s.links[1].joint.pose.orientation = {std::sqrt(0.5), 0, 0, std::sqrt(0.5)};
  s.end_effectors = {effector("tip", "lower_joint", {0, -0.2, 0.05}),
                     effector("middle", "bracket_joint", {0.1, 0, 0})};
  const double a = 0.7, b = -1.9, va = 1.3, vb = -0.4;
  const double c = std::cos(a), d = std::sin(a), e = std::cos(a + b), f = std::sin(a + b);
  const Reading r = read(Model(s), {a, b}, {va, vb});
  // In the bracket's axes -y is x of the upper arm: 0.5 + 0.4 along it to the elbow, 0.2 along the
  // lower arm.
  expect_near(r.position,
              {0.1 + 0.9 * c + 0.2 * e, 0.2 + 0.9 * d + 0.2 * f, 0.35,  //
               0.1 + 0.5 * c - 0.1 * d, 0.2 + 0.5 * d + 0.1 * c, 0.3},
              1e-15, "position");
  expect_near(r.velocity,
              {-0.9 * d * va - 0.2 * f * (va + vb), 0.9 * c * va + 0.2 * e * (va + vb), 0,  //
               (-0.5 * d - 0.1 * c) * va, (0.5 * c - 0.1 * d) * va, 0},
              1e-15, "velocity");
  expect_near(r.jacobian,
              {-0.9 * d - 0.2 * f, -0.2 * f, 0.9 * c + 0.2 * e, 0.2 * e, 0, 0,  //
               -0.5 * d - 0.1 * c, 0, 0.5 * c - 0.1 * d, 0, 0, 0},
              1e-15, "jacobian");
}

TEST(EndEffectors, OfAFreeBodyTurnAndFlyWithIt) {
  Scene s;
  s.links = {link("ball", JointType::free, {1, 2, 3}, SphereShape{0.1}, 500),
             link("wall", JointType::fixed, {0, 5, 0}, SphereShape{0.1}, 500)};
  s.end_effectors = {effector("mark", "ball_joint", {0.1, 0.2, 0.3}),
                     effector("nail", "wall_joint", {0, 0, 0.5})};
  // A third of a turn about (1, 1, 1): x → y → z → x.
  const Reading r = read(Model(s), {0.5, 0.25, 0.125, 0.5, 0.5, 0.5, 0.5}, {1, -1, 2, 3, 0, 0});
  expect_near(r.position, {1 + 0.5 + 0.3, 2 + 0.25 + 0.1, 3 + 0.125 + 0.2, 0, 5, 0.5}, 1e-15,
              "position");
  // ω = 3 x in body axes: ω × p = 3 (0, -0.3, 0.2) there, (0.6, 0, -0.9) in the world.
  expect_near(r.velocity, {1 + 0.6, -1, 2 - 0.9, 0, 0, 0}, 1e-15, "velocity");
  // Columns of rotation: e × p in body axes; the pose moves each component on by one.
  expect_near(r.jacobian, {1, 0, 0, 0.2,  -0.1, 0,     //
                           0, 1, 0, 0,    0.3,  -0.2,  //
                           0, 0, 1, -0.3, 0,    0.1,   //
                           0, 0, 0, 0,    0,    0,    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},
              1e-15, "jacobian");
}

/// A random tree with an end effector on every joint.
Scene marked_tree(unsigned seed) {
  Scene s = testing::random_tree(seed, 9);
  Random random(seed + 77);
  for (const LinkDescription& l : s.links)
    s.end_effectors.push_back(
        effector("on_" + l.joint.name, l.joint.name, testing::array(random.vector(0.2))));
  return s;
}
std::vector<double> random_numbers(Random& random, int count) {
  std::vector<double> x(static_cast<std::size_t>(count));
  for (double& value : x) value = random.uniform(-1, 1);
  return x;
}
/// Moves q by `by` along a dof, with rotations on the right.
std::vector<double> moved(const Model& model, std::vector<double> q, int dof, double by) {
  for (const kernels::Link& l : compiled(model).links) {
    const int k = dof - l.v;
    if (k < 0 || k >= kernels::dofs(l.kind)) continue;
    double* const at = &q[std::size_t(l.q)];
    if (l.kind == kernels::JointKind::spherical) {
      const Vec3<double> x = {k == 0 ? by : 0, k == 1 ? by : 0, k == 2 ? by : 0};
      const kernels::Quat<double> o = kernels::rotate_by<double>({at[0], at[1], at[2], at[3]}, x);
      at[0] = o.w, at[1] = o.x, at[2] = o.y, at[3] = o.z;
    } else {
      at[k] += by;
    }
  }
  return q;
}

TEST(EndEffectors, JacobianIsTheDifferenceOfPositionsAndGivesTheVelocity) {
  double largest = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    const Model model(marked_tree(seed));
    Random random(seed + 500);
    Batch batch(model, 1);
    batch.set_state(0, random_numbers(random, model.nq()), random_numbers(random, model.nv()));
    const std::vector<double> q = testing::q_of(batch),
                              v = testing::v_of(batch);  // quaternions normalised
    const Reading r = read(model, q, v);
    const auto nv = std::size_t(model.nv()), rows = r.position.size();
    std::vector<double> product(rows, 0.0);
    for (std::size_t dof = 0; dof < nv; ++dof) {
      constexpr double kStep = 1e-5;
      const std::vector<double> up = read(model, moved(model, q, int(dof), kStep), v).position;
      const std::vector<double> down = read(model, moved(model, q, int(dof), -kStep), v).position;
      for (std::size_t i = 0; i < rows; ++i) {
        const double derivative = r.jacobian[i * nv + dof];
        EXPECT_NEAR(derivative, (up[i] - down[i]) / (2 * kStep), 1e-9)
            << "seed " << seed << ", row " << i << ", dof " << dof;
        product[i] += derivative * v[dof];
        largest = std::max(largest, std::abs(derivative));
      }
    }
    expect_near(r.velocity, product, 1e-13, "velocity, seed " + std::to_string(seed));
  }
  EXPECT_GT(largest, 0.5) << "nothing moves: no test";
}

TEST(EndEffectors, VelocityIsThatOfTheMotion) {
  // Second order in the step: a fifth of the step gives about a twenty-fifth of the error.
  const Model model(marked_tree(3));
  const auto error = [&](double h) {
    Random random(9);
    Batch batch(model, 1);
    batch.set_state(0, random_numbers(random, model.nq()), random_numbers(random, model.nv()));
    Stepper stepper(model, testing::options(Integrator::sdirk2, h));
    Readout readout(model);
    const Reading before = read(readout, batch);
    testing::step_all(stepper, batch, {});
    const Reading middle = read(readout, batch);
    testing::step_all(stepper, batch, {});
    EXPECT_EQ(batch.failed_count(), 0);
    const Reading after = read(readout, batch);
    double largest = 0, speed = 0;
    for (std::size_t i = 0; i < after.position.size(); ++i) {
      largest = std::max(largest, std::abs((after.position[i] - before.position[i]) / (2 * h) -
                                           middle.velocity[i]));
      speed = std::max(speed, std::abs(middle.velocity[i]));
    }
    EXPECT_GT(speed, 0.3);
    return largest;
  };
  const double coarse = error(1e-4), fine = error(2e-5);
  EXPECT_LT(coarse, 1e-3);
  EXPECT_LT(fine, coarse / 12);
}

TEST(EndEffectors, AreTheSameBitsInAnyBatch) {
  const Model model(marked_tree(5));
  constexpr int kEnvironments = 21;  // a block, and one with a group and a part of another
  Batch batch(model, kEnvironments);
  Random random(4);
  for (int e = 0; e < kEnvironments; ++e)
    batch.set_state(e, random_numbers(random, model.nq()), random_numbers(random, model.nv()));
  Readout readout(model);
  const std::size_t n = 3 * model.end_effectors().size();
  std::vector<std::vector<double>> all(kEnvironments, std::vector<double>(n));
  for (int block = 0; block < batch.blocks(); ++block) {
    std::vector<std::span<double>> spans;
    for (int e = 16 * block; e < std::min(16 * block + 16, kEnvironments); ++e)
      spans.emplace_back(all[std::size_t(e)]);
    readout.read_end_effectors(batch, block, spans);
  }
  for (int e = 0; e < kEnvironments; ++e) {
    const Reading here = read(readout, batch, e);
    const Reading alone = read(model, testing::q_of(batch, e), testing::v_of(batch, e));
    EXPECT_EQ(here.position, alone.position) << e;
    EXPECT_EQ(here.velocity, alone.velocity) << e;
    EXPECT_EQ(here.jacobian, alone.jacobian) << e;
    EXPECT_EQ(all[std::size_t(e)], here.position) << e;
    EXPECT_NE(all[std::size_t(e)], all[std::size_t((e + 1) % kEnvironments)]) << e;
  }
}

TEST(EndEffectors, AreListedAndMistakesAreRefused) {
  Scene s = testing::rolling_ball();
  EXPECT_TRUE(Model(s).end_effectors().empty());
  s.end_effectors = {effector("a", "pad_joint", {}), effector("b", "ball_joint", {})};
  const Model model(s);
  ASSERT_EQ(model.end_effectors().size(), 2U);
  EXPECT_EQ(model.end_effectors()[1].name, "b");
  EXPECT_EQ(model.end_effectors()[1].joint, "ball_joint");
  const auto error = [&] {
    try {
      const Model refused(s);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  s.end_effectors[1].joint = "bal_joint";
  EXPECT_THAT(error(), ::testing::HasSubstr("no joint is named 'bal_joint'"));
  s.end_effectors[1] = s.end_effectors[0];
  EXPECT_THAT(error(), ::testing::HasSubstr("endeffector name 'a' is used twice"));
}

}  // namespace
}  // namespace tangere
