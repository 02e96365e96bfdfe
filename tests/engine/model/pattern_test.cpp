// SPDX-License-Identifier: Apache-2.0
// The elimination order against one that counts everything anew at every step, on random trees and
// contacts.
#include "engine/model/pattern.hpp"

#include <gmock/gmock.h>

#include <random>

#include "kernels/step/lu.hpp"

namespace tangere {
namespace {

using Matrix = std::vector<std::vector<char>>;

kernels::Link link_of(int parent, kernels::JointKind kind, int v) {
  kernels::Link link{};
  link.parent = parent;
  link.kind = kind;
  link.v = v;
  return link;
}

/// Which entries the pattern says exist.
Matrix structure_of(const PatternStorage& p) {
  Matrix s(p.n, std::vector<char>(p.n, 0));
  for (int i = 0; i < p.n; ++i)
    for (int j = 0; j < p.n; ++j) s[i][j] = p.slot[i * p.n + j] >= 0 ? 1 : 0;
  return s;
}

/// The dof that creates fewest new entries, the lowest index on ties; `s` becomes filled.
std::vector<int> order_of(Matrix& s) {
  const int n = static_cast<int>(s.size());
  std::vector<int> order;
  std::vector<char> gone(n, 0);
  const auto missing = [&](int p, const auto& each) {
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        if (!gone[i] && !gone[j] && i != p && j != p && s[i][p] && s[p][j] && !s[i][j]) each(i, j);
  };
  for (int step = 0; step < n; ++step) {
    int best = -1;
    long fewest = 0;
    for (int p = 0; p < n; ++p) {
      if (gone[p]) continue;
      long fill = 0;
      missing(p, [&](int, int) { ++fill; });
      if (best < 0 || fill < fewest) best = p, fewest = fill;
    }
    missing(best, [&](int i, int j) { s[i][j] = 2; });
    gone[best] = 1;
    order.push_back(best);
  }
  return order;
}

/// Carries out the lists of the pattern on symbols: every factor slot that a run changes has to be
/// the one of the row and the column that the elimination means.
void expect_runs_lead_to_their_columns(const PatternStorage& p) {
  const PatternPartStorage& all = p.whole;
  for (int k = 0; k < p.n; ++k)
    for (int c = all.lower_begin[k]; c < all.lower_begin[k + 1]; ++c) {
      EXPECT_EQ(p.factor_column[all.lower_slot[c]], k);
      int covered = 0;
      for (int r = all.run_begin[c]; r < all.run_begin[c + 1]; ++r)
        for (int e = 0; e < all.runs[r].length; ++e, ++covered)
          EXPECT_EQ(p.factor_column[all.runs[r].source + e],
                    p.factor_column[all.runs[r].target + e]);
      EXPECT_EQ(covered, p.row_begin[k + 1] - p.diagonal[k] - 1);
    }
}

/// Where no contact couples dofs, the part without contacts gives the bits of the whole pattern,
/// and does less. Numbers are in the entries that `alone` has, too.
void expect_the_same_bits_apart(const PatternStorage& p, const PatternStorage& alone,
                                std::mt19937& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  const auto n = std::size_t(p.n);
  std::vector<double> A(std::size_t(p.entries), 0.0), b(n);
  for (int i = 0; i < p.n; ++i)
    for (int j = 0; j < p.n; ++j)
      if (alone.slot[i * p.n + j] >= 0)
        A[std::size_t(p.slot[i * p.n + j])] = number(random) + (i == j ? p.n : 0);
  for (double& x : b) x = number(random);
  const kernels::Pattern view = p.view();
  std::vector<std::vector<double>> results;
  for (const kernels::PatternPart& part : {view.whole, view.apart}) {
    std::vector<double> LU(std::size_t(p.factor_entries)), x(n), back(n), sound(1);
    std::vector<double> work(std::max(LU.size(), 5 * n));
    kernels::factor<double>(view, part, A.data(), nullptr, LU.data(), work.data());
    kernels::solve_watched<false>(view, part, A.data(), LU.data(), b.data(), x.data(), sound.data(),
                                  work.data());
    kernels::solve_watched<true>(view, part, A.data(), LU.data(), b.data(), back.data(),
                                 sound.data(), work.data());
    EXPECT_EQ(sound[0], 1);
    x.insert(x.end(), back.begin(), back.end());
    results.push_back(x);
  }
  EXPECT_EQ(results[0], results[1]);
  EXPECT_LE(p.apart.lower_slot.size(), p.whole.lower_slot.size());
}

TEST(Pattern, EliminatesWhatCreatesFewestEntriesFirst) {
  std::mt19937 random(3);
  for (int round = 0; round < 60; ++round) {
    std::vector<kernels::Link> links;
    int nv = 0;
    const int count = 1 + static_cast<int>(random() % 12);
    for (int i = 0; i < count; ++i) {
      const auto kind =
          random() % 2 == 0 ? kernels::JointKind::revolute : kernels::JointKind::spherical;
      const int parent = static_cast<int>(random() % std::uint32_t(i + 1)) - 1;
      links.push_back(link_of(parent, kind, nv));
      nv += kernels::dofs(kind);
    }
    std::vector<std::pair<int, int>> touching;
    for (int k = static_cast<int>(random() % 8); k > 0; --k)
      touching.emplace_back(random() % std::uint32_t(count), random() % std::uint32_t(count));
    const PatternStorage p = analyse_pattern(links, nv, touching);
    Matrix filled = structure_of(p);
    ASSERT_EQ(p.permutation, order_of(filled)) << "round " << round;
    int entries = 0;
    for (const auto& row : filled)
      entries += int(row.size() - std::count(row.begin(), row.end(), 0));
    EXPECT_EQ(p.factor_entries, entries) << "round " << round;
    expect_runs_lead_to_their_columns(p);
    expect_the_same_bits_apart(p, analyse_pattern(links, nv, {}), random);
  }
}

/// 400 free bodies took a minute and more when each step counted all entries anew.
TEST(Pattern, ManyBodiesThatDoNotTouchHaveNoFill) {
  std::vector<kernels::Link> links;
  for (int i = 0; i < 800; ++i) links.push_back(link_of(-1, kernels::JointKind::spherical, 3 * i));
  const PatternStorage p = analyse_pattern(links, 2400, {});
  EXPECT_EQ(p.entries, 9 * 800);
  EXPECT_EQ(p.factor_entries, p.entries);
}

}  // namespace
}  // namespace tangere
