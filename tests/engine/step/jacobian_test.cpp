// SPDX-License-Identifier: Apache-2.0
// Tests the analytic Jacobian of the residual by three routes, on random trees with and without
// contact, with every joint kind.
#include <gtest/gtest.h>

#include <algorithm>

#include "engine/model/compile.hpp"
#include "kernels/numbers/dual.hpp"
#include "tests/engine/random_followers.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using testing::Random;
using testing::StageBuffers;
using D = kernels::Dual<double>;

constexpr double kStep = 0.004, kC0 = 1.5;

double norm_of(const CompiledModel& m, const StageBuffers<double>& b) {
  double worst = 0;
  for (int i = 0; i < m.nv; ++i)
    for (int j = 0; j < m.nv; ++j) worst = std::max(worst, std::abs(b.entry(b.A, i, j)));
  return worst;
}

/// Measures each row by its own largest entry, because rows of light and heavy bodies differ by
/// many decades.
std::vector<double> row_scales(const CompiledModel& m, const StageBuffers<double>& b) {
  std::vector<double> scale(std::size_t(m.nv), 0);
  for (int i = 0; i < m.nv; ++i)
    for (int j = 0; j < m.nv; ++j)
      scale[std::size_t(i)] = std::max(scale[std::size_t(i)], std::abs(b.entry(b.A, i, j)));
  return scale;
}

template <class N>
void copy_stage(const StageBuffers<double>& from, StageBuffers<N>& to) {
  const auto copy = [](const std::vector<double>& a, std::vector<N>& b) {
    for (std::size_t i = 0; i < a.size(); ++i) b[i] = N(a[i]);
  };
  copy(from.centre, to.centre);
  copy(from.x, to.x);
  copy(from.r, to.r);
  copy(from.s, to.s);
  copy(from.tau, to.tau);
  copy(from.target, to.target);
  copy(from.faces, to.faces);
}

/// Whether a dof is eliminated: its row and column of A only keep A regular.
bool is_eliminated(const CompiledModel& m, int dof) {
  const auto is = [&](const auto& of) { return of.v == dof; };
  return std::ranges::any_of(m.transmissions, is) || std::ranges::any_of(m.polynomials, is);
}

void compare_with_dual_numbers(const CompiledModel& m, StageBuffers<double>& b, double tolerance) {
  b.residual_and_jacobian(kC0 / kStep, 1 / kStep);
  const std::vector<double> scale = row_scales(m, b);
  StageBuffers<D> dual(m);
  copy_stage(b, dual);
  for (int j = 0; j < m.nv; ++j) {
    dual.x[std::size_t(j)].epsilon = 1;
    dual.residual(kC0 / kStep, 1 / kStep);
    dual.x[std::size_t(j)].epsilon = 0;
    for (int i = 0; i < m.nv; ++i) {
      if (is_eliminated(m, i) || is_eliminated(m, j)) continue;
      EXPECT_DOUBLE_EQ(dual.g[std::size_t(i)].value, b.g[std::size_t(i)]);
      EXPECT_NEAR(dual.g[std::size_t(i)].epsilon, b.entry(b.A, i, j),
                  tolerance * scale[std::size_t(i)])
          << "entry " << i << ", " << j;
    }
  }
}

/// Compares at so many random states of a scene.
void compare_at_random_states(const Scene& scene, unsigned seed, int states) {
  const auto m = compile(scene);
  StageBuffers<double> b(*m);
  Random random(seed);
  for (int k = 0; k < states; ++k) {
    testing::randomise(b, *m, random, kStep);
    SCOPED_TRACE("seed " + std::to_string(seed));
    compare_with_dual_numbers(*m, b, 1e-11);
  }
}

TEST(Jacobian, TreesMatchDualNumbers) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    compare_at_random_states(testing::random_tree(seed, 2 + static_cast<int>(seed % 9)), seed, 5);
  }
}

TEST(Jacobian, MachinesMatchDualNumbers) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    compare_at_random_states(testing::random_machine(seed, 2 + static_cast<int>(seed % 9)), seed,
                             5);
  }
}

TEST(Jacobian, SharesOfGravityMatchDualNumbers) {
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Scene scene = testing::random_tree(seed, 2 + static_cast<int>(seed % 9));
    testing::share_gravity(scene, seed);
    compare_at_random_states(scene, seed, 3);
  }
}

TEST(Jacobian, LoopsMatchDualNumbers) {
  std::size_t loops = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Scene scene = testing::random_machine(seed, 2 + static_cast<int>(seed % 9));
    testing::close_loops(scene, seed, 3);
    loops += scene.loops.size();
    compare_at_random_states(scene, seed, 5);
  }
  EXPECT_GT(loops, 60U);
}

TEST(Jacobian, TransmissionsMatchDualNumbers) {
  std::size_t transmissions = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Scene scene = testing::random_machine(seed, 2 + static_cast<int>(seed % 7));
    testing::add_transmissions(scene, seed, 4);
    transmissions += scene.transmissions.size();
    compare_at_random_states(scene, seed, 5);
  }
  EXPECT_GT(transmissions, 80U);
}

TEST(Jacobian, PolynomialFollowersMatchDualNumbers) {
  int polynomials = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    Scene scene = testing::following_machine(seed, 3 + static_cast<int>(seed % 7), 1, false);
    if (seed % 3 == 1) testing::add_transmissions(scene, seed, 2);
    if (seed % 3 == 2) testing::close_loops(scene, seed, 2);
    polynomials += testing::count_polynomials(scene);
    compare_at_random_states(scene, seed, 5);
  }
  EXPECT_GT(polynomials, 40);
}

TEST(Jacobian, ContactsWithFixedBodiesMatchDualNumbers) {
  int touched = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const auto m = compile(testing::random_machine_on_a_base(seed, 3 + static_cast<int>(seed % 5)));
    StageBuffers<double> b(*m);
    Random random(seed);
    for (int k = 0; k < 3; ++k) {
      testing::randomise(b, *m, random, kStep);
      SCOPED_TRACE("seed " + std::to_string(seed));
      compare_with_dual_numbers(*m, b, 1e-11);
      for (double f : b.force_scale) touched += f > 1e-3;
    }
  }
  EXPECT_GT(touched, 200);
}

/// Returns how many entries were compared. Leaves out entries with a kink within ±e.
int compare_with_central_differences(const CompiledModel& m, StageBuffers<double>& b, double e,
                                     double tolerance) {
  b.residual_and_jacobian(kC0 / kStep, 1 / kStep);
  const std::vector<double> scale = row_scales(m, b);
  StageBuffers<double> moved(m);
  copy_stage(b, moved);
  int compared = 0;
  for (int j = 0; j < m.nv; ++j) {
    const auto at = [&](double step) {
      moved.x[std::size_t(j)] = b.x[std::size_t(j)] + step;
      moved.residual(kC0 / kStep, 1 / kStep);
      moved.x[std::size_t(j)] = b.x[std::size_t(j)];
      return moved.g;
    };
    const std::vector<double> ahead = at(e), behind = at(-e);
    for (int i = 0; i < m.nv; ++i) {
      const std::size_t k = std::size_t(i);
      const double right = (ahead[k] - b.g[k]) / e, left = (b.g[k] - behind[k]) / e;
      if (std::abs(right - left) > 1e-4 * scale[k]) continue;
      EXPECT_NEAR((ahead[k] - behind[k]) / (2 * e), b.entry(b.A, i, j), tolerance * scale[k])
          << "entry " << i << ", " << j;
      ++compared;
    }
  }
  return compared;
}

TEST(Jacobian, MachinesMatchCentralDifferences) {
  int compared = 0, entries = 0;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const auto m = compile(testing::random_machine(seed, 2 + static_cast<int>(seed % 9)));
    StageBuffers<double> b(*m);
    Random random(seed);
    testing::randomise(b, *m, random, kStep);
    SCOPED_TRACE("seed " + std::to_string(seed));
    compared += compare_with_central_differences(*m, b, 1e-7, 1e-6);
    entries += m->nv * m->nv;
  }
  EXPECT_GT(compared, entries - entries / 50);
}

enum class Effect { damping, armature, spring, limit, position_motor, clipped_motor };
using TypeAndEffect = std::tuple<JointType, Effect>;

class JointEffectJacobian : public ::testing::TestWithParam<TypeAndEffect> {};

/// A joint with one effect between a free body and another. Tests all of its derivatives, and that
/// the effect exists.
TEST_P(JointEffectJacobian, MatchesDualNumbersAndActs) {
  const auto [type, effect] = GetParam();
  const bool mixed = type == JointType::free || type == JointType::free2d;
  if (mixed && effect >= Effect::position_motor)
    GTEST_SKIP() << "no motor on a joint that slides and turns";
  Scene bare = testing::random_tree(3, 3);
  for (std::size_t i = 0; i < 3; ++i)
    bare.links[i].parent = static_cast<int>(i) - 1, bare.links[i].joint.damping = 0;
  bare.links[1].joint.type = type;
  Scene s = bare;
  JointDescription& joint = s.links[1].joint;
  if (effect == Effect::damping) joint.damping = 0.3;
  if (effect == Effect::armature) joint.armature = 0.2;
  if (effect == Effect::spring)
    joint.stiffness = 30, joint.rest.assign(std::size_t(dof_count(type)), 0.2);
  if (effect == Effect::limit) joint.limit_stiffness = 300, joint.limits = {-0.01, 0.02};
  if (effect >= Effect::position_motor) {
    MotorDescription motor{joint.name, -HUGE_VAL, HUGE_VAL, {}, MotorControl::position, 40, 0.2};
    if (effect == Effect::clipped_motor) motor.P = 4, motor.low = -0.5, motor.high = 0.4;
    s.motors.push_back(motor);
  }
  const auto m = compile(s), without = compile(bare);
  StageBuffers<double> b(*m), plain(*without);
  Random random(17);
  int acting = 0, felt = 0;
  // Few random states lie beyond a limit.
  const int states = effect == Effect::limit ? 1000 : 60;
  for (int k = 0; k < states; ++k) {
    testing::randomise(b, *m, random, kStep);
    compare_with_dual_numbers(*m, b, 1e-11);
    copy_stage(b, plain);
    plain.residual_and_jacobian(kC0 / kStep, 1 / kStep);
    acting += plain.g != b.g;
    felt += plain.A != b.A;
  }
  // Inside its limits a joint has no effect. A clipped motor pushes but does not appear in A.
  EXPECT_GT(acting, effect == Effect::limit ? 5 : 19);
  EXPECT_GT(felt, effect == Effect::limit || effect == Effect::clipped_motor ? 1 : 19);
}

INSTANTIATE_TEST_SUITE_P(
    All, JointEffectJacobian,
    ::testing::Combine(::testing::Values(JointType::revolute, JointType::prismatic,
                                         JointType::planar, JointType::translational,
                                         JointType::free2d, JointType::spherical, JointType::free),
                       ::testing::Values(Effect::damping, Effect::armature, Effect::spring,
                                         Effect::limit, Effect::position_motor,
                                         Effect::clipped_motor)));

class ContactJacobian : public ::testing::TestWithParam<ContactLaw> {};

TEST_P(ContactJacobian, ContactsMatchDualNumbers) {
  int touched = 0;
  for (unsigned seed = 1; seed <= 80; ++seed) {
    const auto m =
        compile(testing::random_contacts(seed, 2 + static_cast<int>(seed % 5), GetParam()));
    StageBuffers<double> b(*m);
    Random random(seed);
    for (int k = 0; k < 3; ++k) {
      testing::randomise(b, *m, random, kStep);
      SCOPED_TRACE("seed " + std::to_string(seed));
      compare_with_dual_numbers(*m, b, 1e-11);
      for (double f : b.force_scale) touched += f > 1e-3;
    }
  }
  EXPECT_GT(touched, 200);
}

TEST_P(ContactJacobian, ContactsMatchCentralDifferences) {
  int compared = 0, kinks = 0;
  for (unsigned seed = 101; seed <= 160; ++seed) {
    const auto m = compile(testing::random_contacts(seed, 3, GetParam()));
    StageBuffers<double> b(*m), moved(*m);
    Random random(seed);
    testing::randomise(b, *m, random, kStep);
    b.residual_and_jacobian(kC0 / kStep, 1 / kStep);
    const double scale = norm_of(*m, b);
    copy_stage(b, moved);
    const double e = 1e-9;
    for (int j = 0; j < m->nv; ++j) {
      const auto at = [&](double step) {
        moved.x[std::size_t(j)] = b.x[std::size_t(j)] + step;
        moved.residual(kC0 / kStep, 1 / kStep);
        moved.x[std::size_t(j)] = b.x[std::size_t(j)];
        return moved.g;
      };
      const std::vector<double> ahead = at(e), behind = at(-e);
      for (int i = 0; i < m->nv; ++i) {
        const std::size_t k = std::size_t(i);
        const double right = (ahead[k] - b.g[k]) / e, left = (b.g[k] - behind[k]) / e;
        if (std::abs(right - left) > 1e-4 * scale) {
          ++kinks;  // a contact or a slip began within ±e
          continue;
        }
        EXPECT_NEAR(0.5 * (right + left), b.entry(b.A, i, j), 1e-5 * scale)
            << "seed " << seed << " entry " << i << ", " << j;
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 10 * kinks + 100);
}

INSTANTIATE_TEST_SUITE_P(Laws, ContactJacobian,
                         ::testing::Values(ContactLaw::clamped, ContactLaw::paper,
                                           ContactLaw::linear));

TEST(Jacobian, MassDiagonalIsTheKineticEnergyOfUnitVelocity) {
  // One free cuboid: ½ m and ½ I exactly.
  Scene s;
  LinkDescription l;
  l.name = "box";
  l.joint.name = "joint";
  l.joint.type = JointType::free;
  l.body.name = "box";
  l.body.density = 800;
  l.body.shape = CuboidShape{{0.1, 0.2, 0.3}, {2, 2, 2}};
  s.links = {l};
  const auto m = compile(s);
  StageBuffers<double> b(*m);
  b.centre[3] = 1;
  b.residual_and_jacobian(kC0 / kStep, 1 / kStep);
  const double mass = 800 * 0.1 * 0.2 * 0.3;
  EXPECT_DOUBLE_EQ(b.mass[0], mass);
  EXPECT_NEAR(b.mass[3], mass / 12 * (0.04 + 0.09), 1e-15);
  EXPECT_NEAR(b.mass[5], mass / 12 * (0.01 + 0.04), 1e-15);
}

TEST(Residual, MovingTheSceneChangesNothing) {
  for (double distance : {1e3, 1e7}) {
    Scene near = testing::random_tree(7, 6), far = near;
    for (LinkDescription& l : far.links)
      if (l.parent < 0) l.joint.pose.position[0] += distance;
    const auto m1 = compile(near), m2 = compile(far);
    StageBuffers<double> a(*m1), b(*m2);
    Random random(7);
    testing::randomise(a, *m1, random, kStep);
    copy_stage(a, b);
    a.residual_and_jacobian(kC0 / kStep, 1 / kStep);
    b.residual_and_jacobian(kC0 / kStep, 1 / kStep);
    EXPECT_EQ(a.g, b.g);
    EXPECT_EQ(a.A, b.A);
  }
}

}  // namespace
}  // namespace tangere
