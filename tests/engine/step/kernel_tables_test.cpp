// SPDX-License-Identifier: Apache-2.0
// Tests every kernel table that this machine can run against the plain scalar run of the same
// templates, with poisoned neighbour lanes. AVX2 and AVX-512 agree bit for bit.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <string>

#include "engine/model/compile.hpp"
#include "engine/step/workspace.hpp"
#include "tests/engine/random_machine.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using kernels::kGroup;
using kernels::LaneRow;
using testing::Random;
using testing::StageBuffers;

constexpr double kStep = 0.004, kC0 = 1.5;

/// A workspace whose candidate lists contain every point, in all lanes.
template <int L>
void list_everything(const CompiledModel& m, BasicWorkspace<L>& w) {
  for (std::size_t k = 0; k < m.pairs.size(); ++k) {
    w.own_candidates.reserve(m, k, m.pairs[k].n_points);
    auto& list = w.own_candidates.lists[k];
    list.margin = 1e9;
    for (int l = 0; l < L; ++l) {
      list.own_count[l] = m.pairs[k].n_points;
      if (const double* const areas = m.pairs[k].weights; areas != nullptr)
        std::copy_n(areas, m.pairs[k].n_points, list.own_weights + l * list.stride);
      for (int i = 0; i < list.stride; ++i)
        for (int c = 0; c < 3; ++c)
          list.own[(l * 3 + c) * list.stride + i] =
              i < m.pairs[k].n_points ? m.pairs[k].points[3 * i + c] : kernels::kFarAway;
    }
    if constexpr (L > 1) kernels::active_kernels().transpose_list(list, kAllLanes);
  }
  std::ranges::fill(w.own_candidates.apart, 0);
}

template <int L>
void fill_lane(BasicWorkspace<L>& w, const CompiledModel& m, const StageBuffers<double>& b,
               int lane) {
  for (int i = 0; i < m.nq; ++i) w.stage.centre[i][lane] = b.centre[std::size_t(i)];
  for (int i = 0; i < m.nv; ++i) {
    const std::size_t k = std::size_t(i);
    w.stage.x[i][lane] = b.x[k], w.stage.r[i][lane] = b.r[k], w.stage.s[i][lane] = b.s[k];
    w.stage.tau[i][lane] = b.tau[k], w.stage.target[i][lane] = b.target[k];
  }
  for (std::size_t k = 0; k < b.faces.size(); ++k) w.stage.faces[k][lane] = b.faces[k];
}

template <int L>
void set_constants(BasicWorkspace<L>& w) {
  for (double& x : w.stage.c0_over_h.lane) x = kC0 / kStep;
  for (double& x : w.stage.inverse_h.lane) x = 1 / kStep;
  w.stage.block = nullptr;
  w.stage.group = 0;
}

struct Outputs {
  std::vector<double> g, v, A, wrenches;
};
/// Of the last evaluation.
template <int L>
Outputs outputs(const kernels::KernelTable& table, const BasicWorkspace<L>& w,
                const CompiledModel& m, int lane) {
  Outputs o;
  const std::size_t contacts = m.link_pairs.size() + m.grounded.size();
  table.stage<L>().contact_wrenches(m.view, w.stage, w.wrenches[0]);
  for (std::size_t i = 0; i < 6 * contacts; ++i) o.wrenches.push_back(w.wrenches[0][i][lane]);
  for (int i = 0; i < m.nv; ++i)
    o.g.push_back(w.stage.g[i][lane]), o.v.push_back(w.stage.v[i][lane]);
  for (int e = 0; e < m.pattern.entries; ++e) o.A.push_back(w.stage.A[e][lane]);
  return o;
}

double largest(const std::vector<double>& a) {
  double m = 0;
  for (double x : a) m = std::max(m, std::abs(x));
  return m;
}
void expect_close(const std::vector<double>& a, const std::vector<double>& b, double tolerance) {
  ASSERT_EQ(a.size(), b.size());
  const double scale = largest(b) + 1e-300;
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], tolerance * scale) << i;
}

class KernelTables : public ::testing::TestWithParam<unsigned> {};

/// How the lane under test takes its contacts. Its neighbours have other values.
struct TakenContacts {
  double friction_tangent = 1, normal_share = 1, friction_share = 1;
};

template <int L>
void take_contacts(const TakenContacts& by, kernels::Stage<L>& stage, int lane) {
  for (int l = 0; l < L; ++l) {
    const bool own = l == lane;
    stage.friction_tangent[l] = own ? by.friction_tangent : 1 - by.friction_tangent;
    stage.normal_share[l] = own ? by.normal_share : 0.5 * by.normal_share;
    stage.friction_share[l] = own ? by.friction_share : 0.5 * by.friction_share;
  }
}

void compare_tables(const Scene& scene, unsigned seed, const TakenContacts& by = {}) {
  const auto m = compile(scene);
  StageBuffers<double> b(*m);
  Random random(seed);
  testing::randomise(b, *m, random, kStep);
  b.friction_tangent = by.friction_tangent;
  b.normal_share = by.normal_share, b.friction_share = by.friction_share;
  b.residual_and_jacobian(kC0 / kStep, 1 / kStep);
  Outputs fused;
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    Outputs first;
    for (int lane = 0; lane < kGroup; ++lane)
      for (const double poison : {0.5, std::numeric_limits<double>::quiet_NaN(), 1e300}) {
        Workspace w(*m);
        list_everything(*m, w);
        set_constants(w);
        take_contacts(by, w.stage, lane);
        for (int l = 0; l < kGroup; ++l) fill_lane(w, *m, b, l);
        for (int l = 0; l < kGroup; ++l) {
          if (l == lane) continue;
          for (int i = 0; i < m->nv; ++i) w.stage.x[i][l] = poison;
          for (int i = 0; i < m->nq; ++i) w.stage.centre[i][l] = poison;
          for (std::size_t k = 0; k < b.faces.size(); ++k) w.stage.faces[k][l] = poison;
        }
        table->group.kinematics(m->view, w.stage);
        table->group.evaluate(m->view, w.stage, -1);
        const Outputs o = outputs(*table, w, *m, lane);
        if (first.g.empty()) first = o;
        // The residual without its Jacobian, and a lane evaluated alone across points: the same
        // bits.
        table->group.kinematics(m->view, w.stage);
        table->group.residual(m->view, w.stage, -1);
        const Outputs residual = outputs(*table, w, *m, lane);
        EXPECT_EQ(residual.g, o.g);
        EXPECT_EQ(residual.wrenches, o.wrenches);
        table->group.kinematics(m->view, w.stage);
        table->group.evaluate(m->view, w.stage, lane);
        const Outputs alone = outputs(*table, w, *m, lane);
        EXPECT_EQ(alone.g, o.g);
        EXPECT_EQ(alone.A, o.A);
        EXPECT_EQ(alone.wrenches, o.wrenches);
        table->group.kinematics(m->view, w.stage);
        table->group.residual(m->view, w.stage, lane);
        EXPECT_EQ(outputs(*table, w, *m, lane).g, o.g);
        EXPECT_EQ(o.g, first.g);  // same bits in any lane, whatever the neighbours hold
        EXPECT_EQ(o.A, first.A);
        EXPECT_EQ(o.wrenches, first.wrenches);
      }
    // The kernels of one lane: the same bits once more.
    SingleWorkspace single(*m);
    list_everything(*m, single);
    set_constants(single);
    take_contacts(by, single.stage, 0);
    fill_lane(single, *m, b, 0);
    table->single.kinematics(m->view, single.stage);
    table->single.evaluate(m->view, single.stage, 0);
    const Outputs own = outputs(*table, single, *m, 0);
    EXPECT_EQ(own.g, first.g);
    EXPECT_EQ(own.v, first.v);
    EXPECT_EQ(own.A, first.A);
    EXPECT_EQ(own.wrenches, first.wrenches);
    table->single.residual(m->view, single.stage, 0);
    EXPECT_EQ(outputs(*table, single, *m, 0).g, first.g);
    expect_close(first.g, b.g, 1e-12);
    expect_close(first.v, b.v_out, 1e-13);
    expect_close(first.A, b.A, 1e-12);
    expect_close(first.wrenches, b.wrenches(), 1e-12);
    const std::string name = table->name;
    if (name == "avx2" || name == "avx512") {
      if (fused.g.empty()) fused = first;
      EXPECT_EQ(fused.g, first.g) << "AVX2 and AVX-512 differ";
      EXPECT_EQ(fused.A, first.A) << "AVX2 and AVX-512 differ";
    }
  }
}

TEST_P(KernelTables, EvaluateMatchesTheScalarReferenceWhateverTheNeighboursHold) {
  const unsigned seed = GetParam();
  compare_tables(
      testing::random_contacts(seed, 2 + static_cast<int>(seed % 5), ContactLaw::clamped), seed);
}

TEST_P(KernelTables, FrictionBySecantMatchesTheScalarReferenceWhateverTheNeighboursTake) {
  const unsigned seed = GetParam();
  compare_tables(
      testing::random_contacts(seed, 2 + static_cast<int>(seed % 5), ContactLaw::clamped), seed,
      {.friction_tangent = 0});
}

TEST_P(KernelTables, SofterContactsMatchTheScalarReferenceWhateverTheNeighboursTake) {
  const unsigned seed = GetParam();
  compare_tables(
      testing::random_contacts(seed, 2 + static_cast<int>(seed % 5), ContactLaw::clamped), seed,
      {.normal_share = 0.3, .friction_share = 0.01});
}

TEST_P(KernelTables, SofterContactsAreThoseOfASofterScene) {
  const unsigned seed = GetParam();
  constexpr double kNormal = 0.3, kFriction = 0.01;
  Scene scene = testing::random_contacts(seed, 4, ContactLaw::clamped);
  const auto evaluated = [&](double normal_share, double friction_share) {
    const auto m = compile(scene);
    StageBuffers<double> b(*m);
    Random random(seed);
    testing::randomise(b, *m, random, kStep);
    b.normal_share = normal_share, b.friction_share = friction_share;
    b.residual_and_jacobian(kC0 / kStep, 1 / kStep);
    return std::pair(b.g, b.A);
  };
  const auto softened = evaluated(kNormal, kFriction);
  const auto soften = [&](ContactCoefficients& c) {
    c.kn *= kNormal, c.damping *= kNormal;
    c.kt *= kFriction, c.ks *= kFriction;
  };
  for (auto& contact : scene.pair_contacts) soften(contact.coefficients);
  for (auto& contact : scene.ground_contacts) soften(contact.coefficients);
  EXPECT_EQ(softened, evaluated(1, 1));
}

TEST_P(KernelTables, JointEffectsMatchTheScalarReferenceWhateverTheNeighboursHold) {
  const unsigned seed = GetParam();
  compare_tables(testing::random_machine(seed, 2 + static_cast<int>(seed % 7)), seed);
}

TEST_P(KernelTables, LuSolvesAndJudgesItself) {
  const unsigned seed = GetParam();
  const auto m =
      compile(testing::random_contacts(seed, 2 + static_cast<int>(seed % 7), ContactLaw::clamped));
  const int n = m->nv;
  Random random(seed);
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    Workspace w(*m);
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd rhs(n);
    const int lane = static_cast<int>(seed) % kGroup;
    for (int i = 0; i < n; ++i) {
      rhs[i] = random.normal();
      for (int j = 0; j < n; ++j) {
        const int at = m->pattern.slot[std::size_t(i * n + j)];
        if (at < 0) continue;
        a(i, j) = random.normal() + (i == j ? 5.0 * n : 0.0);
        for (int l = 0; l < kGroup; ++l)
          w.stage.A[at][l] = l == lane ? a(i, j) : std::numeric_limits<double>::quiet_NaN();
      }
      for (int l = 0; l < kGroup; ++l) w.stage.g[i][l] = rhs[i];
    }
    LaneRow accept;
    for (double& x : accept.lane) x = 1;
    table->group.factor(m->view, w.stage, &accept);
    table->group.solve_watched(m->view, w.stage, w.stage.g, w.test, &w.sound);
    table->group.solve(m->view, w.stage, w.stage.g, w.delta);
    const Eigen::VectorXd expected = a.partialPivLu().solve(rhs);
    EXPECT_EQ(w.sound[lane], 1);
    for (int i = 0; i < n; ++i) {
      EXPECT_NEAR(w.test[i][lane], expected[i], 1e-14 * expected.norm());
      EXPECT_NEAR(w.delta[i][lane], expected[i], 1e-12 * expected.norm());
    }
    for (int l = 0; l < kGroup; ++l)
      if (l != lane) {
        EXPECT_EQ(w.sound[l], 0) << "a NaN matrix passed as sound";
      }
    // Lanes that are not accepted keep their factor.
    const double kept = w.stage.LU[0][lane];
    for (double& x : accept.lane) x = 0;
    for (int e = 0; e < m->pattern.entries; ++e) w.stage.A[e][lane] *= 2;
    table->group.factor(m->view, w.stage, &accept);
    EXPECT_EQ(w.stage.LU[0][lane], kept);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, KernelTables, ::testing::Range(1U, 13U));

TEST(KernelTable, AUselessFactorIsNotSound) {
  // A leaf whose own block nearly vanishes although it is coupled: plain elimination loses all
  // digits.
  const auto m = compile(testing::random_contacts(5, 3, ContactLaw::clamped));
  const int n = m->nv;
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    Workspace w(*m);
    Random random(5);
    for (int e = 0; e < m->pattern.entries; ++e)
      for (double& x : w.stage.A[e].lane) x = random.normal();
    const int first = m->pattern.permutation[0];
    for (double& x : w.stage.A[m->pattern.slot[std::size_t(first * n + first)]].lane) x = 1e-25;
    for (int i = 0; i < n; ++i)
      for (double& x : w.stage.g[i].lane) x = random.normal();
    LaneRow accept;
    for (double& x : accept.lane) x = 1;
    table->group.factor(m->view, w.stage, &accept);
    table->group.solve_watched(m->view, w.stage, w.stage.g, w.test, &w.sound);
    for (double s : w.sound.lane) EXPECT_EQ(s, 0) << table->name;
  }
}

TEST(KernelTable, TheReferenceIsAmongThoseCompared) {
  const auto tables = kernels::available_kernels();
  ASSERT_FALSE(tables.empty());
  if (std::string(TANGERE_BUILT_ISAS).find("scalar") == std::string::npos)
    GTEST_SKIP() << "this build has the kernels of " << TANGERE_BUILT_ISAS << " only";
  EXPECT_STREQ(tables.back()->name, "scalar");
}

}  // namespace
}  // namespace tangere
