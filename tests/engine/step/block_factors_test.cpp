// SPDX-License-Identifier: Apache-2.0
// Factors in blocks against dense LU with pivoting, on random trees and contacts; and scenes of
// many
// boxes, whose A is stored in blocks.
#include "engine/step/block_factors.hpp"

#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "engine/model/compiled_model.hpp"
#include "engine/model/pattern.hpp"
#include "tests/engine/gradient_run.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using kernels::kGroup;
using kernels::Row;
using testing::link;
using testing::q_of;
using testing::Random;
using testing::RunGradient;
using testing::RunInput;
using testing::StateLoss;

/// Free bodies, joints of one dof, and trees of more dofs than a vector has lanes.
std::vector<kernels::Link> random_trees(std::mt19937& random, int trees) {
  std::vector<kernels::Link> links;
  int nv = 0;
  for (int t = 0; t < trees; ++t) {
    static constexpr int kLinks[] = {1, 2, 2, 5};
    for (int i = kLinks[random() % 4], parent = -1; i > 0; --i) {
      kernels::Link link{};
      link.parent = parent;
      link.kind = random() % 3 == 0 ? kernels::JointKind::revolute : kernels::JointKind::spherical;
      link.v = nv;
      nv += kernels::dofs(link.kind);
      parent = static_cast<int>(links.size());
      links.push_back(link);
    }
  }
  return links;
}

/// Numbers of all lanes, and the blocks that some lane has.
template <int L>
struct Case {
  std::vector<kernels::Link> links;
  PatternStorage storage;
  kernels::Pattern pattern;
  BlockEntries entries;
  AlignedVector<Row<L>> A, b;

  Case(std::vector<kernels::Link> all, int nv) : links(std::move(all)) {
    storage = block_pattern(links, nv);
    pattern = storage.view();
    entries.reset(pattern);
  }
  void make_room() {
    A.assign(std::size_t(entries.entries()), Row<L>{});
    b.assign(std::size_t(pattern.n), Row<L>{});
  }
  [[nodiscard]] Eigen::MatrixXd dense(int lane) const {
    Eigen::MatrixXd m = Eigen::MatrixXd::Zero(pattern.n, pattern.n);
    for (int i = 0; i < pattern.n; ++i)
      for (int j = 0; j < pattern.n; ++j)
        if (const int e = entries.entry(pattern, i, j); e >= 0) m(i, j) = A[std::size_t(e)][lane];
    return m;
  }
};

/// Fills one lane: all trees, and some of the blocks that couple them.
template <int L>
void fill_lane(Case<L>& c, int lane, std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  const kernels::Pattern& p = c.pattern;
  for (int e = 0; e < p.entries; ++e) c.A[std::size_t(e)][lane] = number(random);
  for (int i = 0; i < p.n; ++i) c.A[std::size_t(p.diagonal_entry[i])][lane] += 0.7 * p.n;
  const auto& coupling = c.entries.coupling();
  for (std::size_t k = 0; k < coupling.size(); k += 2) {
    const int end = k + 2 < coupling.size() ? coupling[k + 2].first : c.entries.entries();
    const bool touches = random() % 2 == 0;
    for (int e = coupling[k].first; e < end; ++e)
      c.A[std::size_t(e)][lane] = touches ? number(random) : 0;
  }
  for (Row<L>& row : c.b) row[lane] = number(random);
}

double largest_error(const Eigen::VectorXd& expected, const Row<kGroup>* x, int lane) {
  double error = 0;
  for (int i = 0; i < expected.size(); ++i)
    error = std::max(error, std::abs(x[i][lane] - expected[i]));
  return error / expected.lpNorm<Eigen::Infinity>();
}

TEST(BlockFactors, SolveWhatDenseEliminationSolves) {
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    const std::vector<kernels::Link> links = random_trees(random, 3 + round);
    Case<kGroup> c(links, links.back().v + kernels::dofs(links.back().kind));
    const auto trees = std::uint32_t(c.pattern.n_trees);
    for (int k = 0; k < 3 * c.pattern.n_trees; ++k)
      c.entries.couple(c.pattern, int(random() % trees), int(random() % trees));
    c.make_room();
    for (int l = 0; l < kGroup; ++l) fill_lane(c, l, random);
    for (const kernels::KernelTable* table : kernels::available_kernels()) {
      SCOPED_TRACE(table->name);
      BlockFactors factors(c.pattern, kGroup);
      AlignedVector<Row<kGroup>> x(c.b.size()), back(c.b.size()), plain(c.b.size());
      for (int l = 0; l < kGroup; ++l) {
        const auto poisoned = c.A;
        for (int other = 0; other < kGroup; ++other)
          for (auto& row : c.A)
            if (other != l) row[other] = NAN;
        factors.factor(*table, c.pattern, c.entries, c.A.data(), l);
        c.A = poisoned;
        EXPECT_TRUE(factors.solve_watched(*table, false, l, c.b.data(), x.data()));
        EXPECT_TRUE(factors.solve_watched(*table, true, l, c.b.data(), back.data()));
        factors.solve(*table, l, c.b.data(), plain.data());
        const Eigen::MatrixXd dense = c.dense(l);
        Eigen::VectorXd b(c.pattern.n);
        for (int i = 0; i < c.pattern.n; ++i) b[i] = c.b[std::size_t(i)][l];
        EXPECT_LE(largest_error(dense.lu().solve(b), x.data(), l), 1e-12);
        EXPECT_LE(largest_error(dense.lu().solve(b), plain.data(), l), 1e-10);
        EXPECT_LE(largest_error(dense.transpose().lu().solve(b), back.data(), l), 1e-12);
      }
    }
  }
}

/// The order in which blocks were found, and blocks that are zero, change no bit.
TEST(BlockFactors, NeighboursChangeNoBit) {
  std::mt19937 random(8);
  const std::vector<kernels::Link> links = random_trees(random, 12);
  const int nv = links.back().v + kernels::dofs(links.back().kind);
  Case<kGroup> group(links, nv);
  for (int k = 0; k < 40; ++k)
    group.entries.couple(group.pattern, int(random() % 12), int(random() % 12));
  group.make_room();
  for (int l = 0; l < kGroup; ++l) fill_lane(group, l, random);
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    BlockFactors factors(group.pattern, kGroup);
    AlignedVector<Row<kGroup>> x(group.b.size());
    for (int l = 0; l < kGroup; ++l) {
      factors.factor(*table, group.pattern, group.entries, group.A.data(), l);
      EXPECT_TRUE(factors.solve_watched(*table, false, l, group.b.data(), x.data()));
      Case<1> lone(links, nv);
      const auto& coupling = group.entries.coupling();
      for (std::size_t k = coupling.size(); k > 0; k -= 2) {  // the last found first
        const BlockEntries::Block& block = coupling[k - 2];
        if (group.A[std::size_t(block.first)][l] != 0)
          lone.entries.couple(lone.pattern, block.row, block.column);
      }
      lone.make_room();
      for (int i = 0; i < nv; ++i) {
        lone.b[std::size_t(i)][0] = group.b[std::size_t(i)][l];
        for (int j = 0; j < nv; ++j) {
          const int to = lone.entries.entry(lone.pattern, i, j);
          if (to >= 0)
            lone.A[std::size_t(to)][0] =
                group.A[std::size_t(group.entries.entry(group.pattern, i, j))][l];
        }
      }
      BlockFactors own(lone.pattern, 1);
      AlignedVector<Row<1>> alone(lone.b.size());
      own.factor(*table, lone.pattern, lone.entries, lone.A.data(), 0);
      EXPECT_TRUE(own.solve_watched(*table, false, 0, lone.b.data(), alone.data()));
      for (int i = 0; i < nv; ++i) EXPECT_EQ(alone[std::size_t(i)][0], x[std::size_t(i)][l]);
    }
  }
}

TEST(BlockFactors, AMatrixThatHasNoInverseIsNotTrusted) {
  std::mt19937 random(2);
  const std::vector<kernels::Link> links = random_trees(random, 10);
  Case<1> c(links, links.back().v + kernels::dofs(links.back().kind));
  c.make_room();
  fill_lane(c, 0, random);
  for (int j = 0; j < c.pattern.n; ++j)
    if (const int e = c.entries.entry(c.pattern, 0, j); e >= 0) c.A[std::size_t(e)][0] = 0;
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    BlockFactors factors(c.pattern, 1);
    AlignedVector<Row<1>> x(c.b.size());
    factors.factor(*table, c.pattern, c.entries, c.A.data(), 0);
    EXPECT_FALSE(factors.solve_watched(*table, false, 0, c.b.data(), x.data()));
  }
}

/// Layers of four boxes that fall on each other. `declared`: pairs of boxes more layers apart than
/// this have no contact.
Scene boxes(int count, int declared) {
  Scene s;
  s.name = "boxes";
  s.integrator = Integrator::bdf1;
  s.timestep = 5e-3;
  s.ground = GroundDescription{};
  Random random(4);
  for (int i = 0; i < count; ++i) {
    const std::string name = "b" + std::to_string(i);
    const Vector3 at = {0.046 * (i % 2) + 0.002 * random.normal() / 3,
                        0.046 * (i / 2 % 2) + 0.002 * random.normal() / 3,
                        0.0201 + 0.0402 * (i / 4)};
    s.links.push_back(
        link(name, JointType::free, at, CuboidShape{{0.04, 0.04, 0.04}, {4, 4, 4}}, 600));
    s.ground_contacts.push_back({name, {5e3, 5, 0.6, 100}, ContactLaw::clamped, 1e-5, {}});
    for (int j = 0; j < count; ++j)
      if (j != i && std::abs(i / 4 - j / 4) <= declared)
        s.pair_contacts.push_back(
            {name, "b" + std::to_string(j), {5e3, 5, 0.6, 1e3}, ContactLaw::clamped, 1e-5, {}});
  }
  return s;
}

/// The start of a run in which box 0 moves sideways, faster in later environments.
RunInput start_of(const Model& model, int environment, int steps) {
  RunInput in;
  in.q = q_of(Batch(model, 1));
  in.v.assign(std::size_t(model.nv()), 0.0);
  in.v[0] = 0.1 + 0.02 * environment;
  in.u.resize(std::size_t(steps));
  return in;
}

std::vector<double> state_after(const Model& model, int first, int environments, int steps, int e) {
  Batch batch(model, environments);
  for (int k = 0; k < environments; ++k) {
    const RunInput in = start_of(model, first + k, steps);
    batch.set_state(k, in.q, in.v);
  }
  Stepper stepper(model, testing::options(Integrator::bdf1, 5e-3));
  for (int t = 0; t < steps; ++t) testing::step_all(stepper, batch, {});
  EXPECT_FALSE(failed(batch.status(e)));
  std::vector<double> all = q_of(batch, e), v = testing::v_of(batch, e);
  all.insert(all.end(), v.begin(), v.end());
  return all;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

/// Which pairs are declared decides how A is stored. Pairs that never come near change nothing
/// else.
TEST(BlockFactors, StatesAndGradientsAreThoseOfThePatternOfAllPairs) {
  const Model all(boxes(10, 2)), near(boxes(10, 1));
  ASSERT_EQ(compiled(all).view.pattern.slot, nullptr);
  ASSERT_NE(compiled(near).view.pattern.slot, nullptr);
  EXPECT_LE(largest_difference(state_after(all, 0, 1, 25, 0), state_after(near, 0, 1, 25, 0)),
            1e-9);
  const int steps = 6;
  std::vector<RunGradient> gradients;
  for (const Model& model : {all, near}) {
    const StateLoss loss(model, steps, 3);
    gradients.push_back(testing::adjoint_of_run(model, testing::options(Integrator::bdf1, 5e-3),
                                                {start_of(model, 0, steps)}, loss, 0));
  }
  const double size = gradients[1].norm();
  EXPECT_GT(size, 1);
  EXPECT_LE(largest_difference(gradients[0].q, gradients[1].q), 1e-9 * size);
  EXPECT_LE(largest_difference(gradients[0].v, gradients[1].v), 1e-9 * size);
}

TEST(BlockFactors, AStateHasTheSameBitsAloneAndAmongOthers) {
  const Model model(boxes(12, 2));
  for (const int e : {0, 3, 8}) {
    const std::vector<double> among = state_after(model, 0, 9, 20, e);
    EXPECT_EQ(among, state_after(model, e, 1, 20, 0));
    EXPECT_EQ(among, state_after(model, e - e % 3, 20, 20, e % 3));
  }
}

TEST(BlockFactors, AreChosenWhereMostPairsCannotTouchAtATime) {
  EXPECT_NE(compiled(Model(boxes(8, 9))).view.pattern.slot, nullptr);
  EXPECT_EQ(compiled(Model(boxes(16, 9))).view.pattern.slot, nullptr);
}

}  // namespace
}  // namespace tangere
