// SPDX-License-Identifier: Apache-2.0
// Finds a greedy elimination order, then runs of factor entries that one loop can process.
#include "engine/model/pattern.hpp"

#include <algorithm>

namespace tangere {

namespace {

using Structure = std::vector<std::vector<char>>;

/// Returns the dofs that move a body: those of its link and of every ancestor.
std::vector<int> support(const std::vector<kernels::Link>& links, int link) {
  std::vector<int> dofs;
  for (int i = link; i >= 0; i = links[i].parent)
    for (int k = 0; k < kernels::dofs(links[i].kind); ++k) dofs.push_back(links[i].v + k);
  return dofs;
}

void couple(Structure& s, const std::vector<int>& dofs) {
  for (int i : dofs)
    for (int j : dofs) s[i][j] = 1;
}

/// Eliminates at every step the dof that creates fewest new entries; the lowest index on ties.
std::vector<int> minimum_fill_order(Structure s) {
  const int n = static_cast<int>(s.size());
  std::vector<int> order;
  std::vector<char> gone(n, 0);
  for (int step = 0; step < n; ++step) {
    int best = -1;
    long best_fill = 0;
    for (int p = 0; p < n; ++p) {
      if (gone[p]) continue;
      long fill = 0;
      for (int i = 0; i < n; ++i) {
        if (gone[i] || i == p || !s[i][p]) continue;
        for (int j = 0; j < n; ++j) fill += !gone[j] && j != p && s[p][j] && !s[i][j];
      }
      if (best < 0 || fill < best_fill) best = p, best_fill = fill;
    }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        if (!gone[i] && !gone[j] && s[i][best] && s[best][j]) s[i][j] = 1;
    gone[best] = 1;
    order.push_back(best);
  }
  return order;
}

}  // namespace

PatternStorage analyse_pattern(const std::vector<kernels::Link>& links, int nv,
                               const std::vector<std::pair<int, int>>& touching) {
  Structure s(nv, std::vector<char>(nv, 0));
  for (int i = 0; i < static_cast<int>(links.size()); ++i) couple(s, support(links, i));
  for (const auto& [first, second] : touching) {
    std::vector<int> both = support(links, first);
    const std::vector<int> other = support(links, second);
    both.insert(both.end(), other.begin(), other.end());
    couple(s, both);
  }

  PatternStorage p;
  p.n = nv;
  p.slot.assign(std::size_t(nv) * nv, -1);
  for (int i = 0; i < nv; ++i) {
    p.entry_begin.push_back(p.entries);
    for (int j = 0; j < nv; ++j) {
      if (!s[i][j]) continue;
      p.slot[std::size_t(i) * nv + j] = p.entries++;
      p.entry_column.push_back(j);
    }
  }
  p.entry_begin.push_back(p.entries);

  p.permutation = minimum_fill_order(s);
  std::vector<int> step_of(nv);
  for (int k = 0; k < nv; ++k) step_of[p.permutation[k]] = k;
  // Structure in elimination order, with fill.
  Structure f(nv, std::vector<char>(nv, 0));
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < nv; ++j) f[i][j] = s[p.permutation[i]][p.permutation[j]];
  for (int k = 0; k < nv; ++k)
    for (int i = k + 1; i < nv; ++i)
      for (int j = k + 1; j < nv; ++j) f[i][j] = static_cast<char>(f[i][j] | (f[i][k] & f[k][j]));
  std::vector<int> at(std::size_t(nv) * nv, -1);
  for (int i = 0; i < nv; ++i) {
    p.row_begin.push_back(p.factor_entries);
    for (int j = 0; j < nv; ++j) {
      if (!f[i][j]) continue;
      at[std::size_t(i) * nv + j] = p.factor_entries++;
      p.factor_column.push_back(j);
    }
    p.diagonal.push_back(at[std::size_t(i) * nv + i]);
  }
  p.row_begin.push_back(p.factor_entries);
  p.scatter.resize(p.entries);
  for (int i = 0; i < nv; ++i)
    for (int e = p.entry_begin[i]; e < p.entry_begin[i + 1]; ++e)
      p.scatter[e] = at[std::size_t(step_of[i]) * nv + step_of[p.entry_column[e]]];
  const auto slot = [&](int i, int j) { return at[std::size_t(i) * nv + j]; };
  for (int k = 0; k < nv; ++k) {
    p.lower_begin.push_back(static_cast<int>(p.lower_slot.size()));
    for (int i = k + 1; i < nv; ++i) {
      if (!f[i][k]) continue;
      p.lower_slot.push_back(slot(i, k));
      p.run_begin.push_back(static_cast<int>(p.runs.size()));
      bool open = false;
      for (int j = k + 1; j < nv; ++j) {
        if (!f[k][j]) continue;
        open = open && slot(i, j) == p.runs.back().target + p.runs.back().length;
        if (!open) p.runs.push_back({slot(k, j), slot(i, j), 0});
        open = true;
        ++p.runs.back().length;
      }
    }
  }
  p.lower_begin.push_back(static_cast<int>(p.lower_slot.size()));
  p.run_begin.push_back(static_cast<int>(p.runs.size()));
  return p;
}

kernels::Pattern PatternStorage::view() const {
  return {n,
          entries,
          slot.data(),
          entry_begin.data(),
          entry_column.data(),
          factor_entries,
          permutation.data(),
          scatter.data(),
          row_begin.data(),
          diagonal.data(),
          factor_column.data(),
          lower_begin.data(),
          lower_slot.data(),
          run_begin.data(),
          runs.data()};
}

}  // namespace tangere
