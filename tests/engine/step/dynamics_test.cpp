// SPDX-License-Identifier: Apache-2.0
// Tests mass matrix, bias, joint forces and accelerations against the dense derivation in world
// axes, on random trees.
#include <gtest/gtest.h>

#include "engine/model/compile.hpp"
#include "tests/engine/dense_dynamics.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using testing::DenseDynamics;
using testing::Random;
using testing::StageBuffers;
using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

/// The kernels' ID(q, v, a) minus the joints' forces. With x = 0, c₀/h = 0 and 1/h = 1, the rates
/// of a stage are r and its a is s.
class Kernels {
 public:
  explicit Kernels(const CompiledModel& m) : m_(m), b_(m) {}

  void set(const Vector& q, const Vector& v, const Vector& target) {
    for (int i = 0; i < m_.nq; ++i) b_.centre[std::size_t(i)] = q[i];
    for (int i = 0; i < m_.nv; ++i)
      b_.r[std::size_t(i)] = v[i], b_.target[std::size_t(i)] = target[i];
  }
  Vector residual(const Vector& a) {
    for (int i = 0; i < m_.nv; ++i) b_.s[std::size_t(i)] = a[i];
    b_.residual(0, 1);
    return Eigen::Map<const Vector>(b_.g.data(), m_.nv);
  }
  /// Computed at rest: the residual is linear in a, and large accelerations make the rounding of
  /// the other terms negligible.
  Matrix mass() {
    b_.r.assign(b_.r.size(), 0);
    const Vector rest = residual(Vector::Zero(m_.nv));
    Matrix M(m_.nv, m_.nv);
    for (int k = 0; k < m_.nv; ++k)
      M.col(k) = (residual(1e6 * Vector::Unit(m_.nv, k)) - rest) / 1e6;
    return M;
  }

 private:
  const CompiledModel& m_;
  StageBuffers<double> b_;
};

struct State {
  Vector q, v, target;
};
State random_state(const CompiledModel& m, Random& random) {
  StageBuffers<double> b(m);
  testing::randomise(b, m, random, 1);
  State s{Eigen::Map<const Vector>(b.centre.data(), m.nq), Vector(m.nv),
          Eigen::Map<const Vector>(b.target.data(), m.nv)};
  for (int i = 0; i < m.nv; ++i) s.v[i] = 2 * random.normal();
  return s;
}

/// Controls in the form that motors take: targets of position motors, while force motors stay in
/// the middle of their range.
std::vector<double> controls(const CompiledModel& m, const Vector& target, Vector& middle) {
  std::vector<double> u;
  middle = Vector::Zero(m.nv);
  for (const CompiledMotor& motor : m.motors) {
    const bool force = motor.control == MotorControl::force;
    u.push_back(force ? 0 : target[motor.dof]);
    if (force) middle[motor.dof] = 0.5 * (motor.low + motor.high);
  }
  return u;
}

void compare(const Scene& scene, unsigned seed, bool solve) {
  const auto m = compile(scene);
  const DenseDynamics<double> dense(scene);
  ASSERT_EQ(dense.nq, m->nq);
  ASSERT_EQ(dense.nv, m->nv);
  Kernels kernels(*m);
  Random random(seed);
  for (int k = 0; k < 3; ++k) {
    const State s = random_state(*m, random);
    Vector middle;
    const auto t = dense.terms(s.q, s.v, controls(*m, s.target, middle));
    kernels.set(s.q, s.v, s.target);
    const Matrix M = kernels.mass();
    kernels.set(s.q, s.v, s.target);
    for (int i = 0; i < m->nv; ++i)
      for (int j = 0; j < m->nv; ++j)
        EXPECT_NEAR(M(i, j), t.mass(i, j), 1e-10 * std::sqrt(t.mass(i, i) * t.mass(j, j)))
            << i << ", " << j;
    const Vector rest = kernels.residual(Vector::Zero(m->nv)) -
                        middle;  // motors known at the start stand in tau, not here
    const Vector expected = t.bias - t.force;
    const double scale = t.bias.norm() + t.force.norm();
    for (int i = 0; i < m->nv; ++i) EXPECT_NEAR(rest[i], expected[i], 1e-10 * scale) << "dof " << i;
    if (!solve) continue;
    const Vector a = dense.acceleration(s.q, s.v, controls(*m, s.target, middle));
    const Vector left = kernels.residual(a) -
                        middle;  // the residual is zero at the independent accelerations; and back
    EXPECT_LT(left.norm(), 1e-10 * (scale + (t.mass * a).norm()));
    const Vector ours = -M.ldlt().solve(rest);
    EXPECT_LT((ours - a).norm(), 1e-10 * a.norm());
  }
}

TEST(Dynamics, TreesMatchTheDenseDerivation) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    compare(testing::random_tree(seed, 2 + static_cast<int>(seed % 9)), seed, true);
  }
}

TEST(Dynamics, MachinesMatchTheDenseDerivation) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    // Two slides along one direction with nothing between them have a singular mass matrix, so this
    // compares only forces.
    compare(testing::random_machine(seed, 2 + static_cast<int>(seed % 9)), seed, false);
  }
}

/// Deep trees of one joint type, because errors would grow with depth.
TEST(Dynamics, SharesOfGravityMatchTheDenseDerivation) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Scene s = testing::random_tree(seed, 2 + static_cast<int>(seed % 5));
    testing::share_gravity(s, seed);
    compare(s, seed, true);
    EXPECT_NE(s.links[0].body.gravity_share, 1);
  }
}

/// Bodies that stand in the world have no share that matters.
TEST(Dynamics, ALinkHasOneShareOfGravity) {
  Scene s = testing::random_tree(3, 4);
  for (LinkDescription& l : s.links) l.joint.type = JointType::revolute;
  s.links[0].joint.type = JointType::fixed;
  s.links[1].parent = s.links[2].parent = 0;
  s.links[3].parent = 2;
  s.links[0].body.gravity_share = 0.5;
  s.links[1].body.gravity_share = 0;
  s.links[3].body.gravity_share = 0.25;
  static_cast<void>(compile(s));
  s.links[3].joint.type = JointType::fixed;
  try {
    static_cast<void>(compile(s));
    FAIL() << "two shares of a link";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what())
                  .find("body 'body3': gravity_share=\"0.25\", and \"1\" of body "
                        "'body2'"),
              std::string::npos)
        << error.what();
  }
}

TEST(Dynamics, DeepChainsMatchTheDenseDerivation) {
  for (JointType type :
       {JointType::revolute, JointType::prismatic, JointType::planar, JointType::translational,
        JointType::free2d, JointType::spherical, JointType::free}) {
    SCOPED_TRACE(to_string(type));
    Scene s = testing::random_tree(9, 12);
    for (std::size_t i = 0; i < s.links.size(); ++i) {
      s.links[i].parent = static_cast<int>(i) - 1;
      s.links[i].joint.type = i % 4 == 3 ? JointType::fixed : type;
    }
    compare(s, 5, false);
  }
}

TEST(Dynamics, SeveralRootsAndBodiesFixedInTheWorld) {
  Scene s = testing::random_tree(21, 8);
  for (std::size_t i = 0; i < s.links.size(); ++i)
    s.links[i].parent = i < 4 ? -1 : static_cast<int>(i) - 4;
  s.links[1].joint.type = JointType::fixed;
  s.links[5].joint.type = JointType::revolute;  // hangs on the body fixed in the world
  compare(s, 6, true);
}

}  // namespace
}  // namespace tangere
