// SPDX-License-Identifier: Apache-2.0
// The elimination order against one that counts everything anew at every step, on random trees and
// contacts.
#include "engine/model/pattern.hpp"

#include <gmock/gmock.h>

#include <random>

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
  for (int k = 0; k < p.n; ++k)
    for (int c = p.lower_begin[k]; c < p.lower_begin[k + 1]; ++c) {
      EXPECT_EQ(p.factor_column[p.lower_slot[c]], k);
      int covered = 0;
      for (int r = p.run_begin[c]; r < p.run_begin[c + 1]; ++r)
        for (int e = 0; e < p.runs[r].length; ++e, ++covered)
          EXPECT_EQ(p.factor_column[p.runs[r].source + e], p.factor_column[p.runs[r].target + e]);
      EXPECT_EQ(covered, p.row_begin[k + 1] - p.diagonal[k] - 1);
    }
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
