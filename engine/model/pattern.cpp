// SPDX-License-Identifier: Apache-2.0
// Finds a greedy elimination order, then runs of factor entries that one loop can process.
#include "engine/model/pattern.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>

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

/// A symmetric structure as a graph of dofs, each with a row of bits: who is its neighbour.
class Graph {
 public:
  explicit Graph(const Structure& s)
      : n_(static_cast<int>(s.size())),
        words_((s.size() + 63) / 64),
        bits_(s.size() * words_),
        fill_(s.size()) {
    for (int i = 0; i < n_; ++i)
      for (int j = 0; j < n_; ++j)
        if (i != j && s[i][j]) set(i, j);
    for (int p = 0; p < n_; ++p) {
      long pairs = 0;
      for (const int i : neighbours(p)) pairs += beyond(p, i) - 1;
      fill_[p] = pairs / 2;
    }
  }

  /// Entries that eliminating dof p would create, on one side of the diagonal.
  [[nodiscard]] long fill(int p) const { return fill_[p]; }

  /// Connects all neighbours of p with each other and takes p out. Returns the neighbours,
  /// ascending. Counts are changed, not counted anew: that would be cubic.
  std::vector<int> eliminate(int p) {
    std::vector<int> around = neighbours(p);
    for (std::size_t k = 0; k < around.size() && fill_[p] > 0; ++k)
      for (std::size_t l = k + 1; l < around.size(); ++l)
        if (!has(around[k], around[l])) connect(around[k], around[l]);
    for (const int i : around) {
      fill_[i] -= beyond(i, p) - 1;
      row(i)[p / 64] &= ~(std::uint64_t{1} << (p % 64));
    }
    return around;
  }

 private:
  std::uint64_t* row(int i) { return bits_.data() + std::size_t(i) * words_; }
  [[nodiscard]] const std::uint64_t* row(int i) const {
    return bits_.data() + std::size_t(i) * words_;
  }
  void set(int i, int j) { row(i)[j / 64] |= std::uint64_t{1} << (j % 64); }
  [[nodiscard]] bool has(int i, int j) const { return (row(i)[j / 64] >> (j % 64) & 1) != 0; }

  /// Neighbours of i that are none of j's; j itself, if it is one of i's, is among them.
  [[nodiscard]] long beyond(int i, int j) const {
    long count = 0;
    for (std::size_t w = 0; w < words_; ++w) count += std::popcount(row(i)[w] & ~row(j)[w]);
    return count;
  }
  template <class Visit>
  void visit(std::size_t word, std::uint64_t bits, const Visit& each) const {
    for (; bits != 0; bits &= bits - 1) each(static_cast<int>(64 * word) + std::countr_zero(bits));
  }
  [[nodiscard]] std::vector<int> neighbours(int p) const {
    std::vector<int> list;
    for (std::size_t w = 0; w < words_; ++w) visit(w, row(p)[w], [&](int i) { list.push_back(i); });
    return list;
  }
  void connect(int i, int j) {
    for (std::size_t w = 0; w < words_; ++w)
      visit(w, row(i)[w] & row(j)[w], [&](int both) { --fill_[both]; });
    fill_[i] += beyond(i, j);
    fill_[j] += beyond(j, i);
    set(i, j);
    set(j, i);
  }

  int n_;
  std::size_t words_;
  std::vector<std::uint64_t> bits_;
  std::vector<long> fill_;
};

struct Elimination {
  std::vector<int> order;
  std::vector<std::vector<int>> left;  ///< of each step, the neighbours that the dof still had
};

/// Eliminates at every step the dof that creates fewest new entries; the lowest index on ties.
Elimination minimum_fill(const Structure& s) {
  Graph graph(s);
  Elimination done;
  std::vector<int> waiting(s.size());
  std::iota(waiting.begin(), waiting.end(), 0);
  while (!waiting.empty()) {
    const auto best = std::min_element(waiting.begin(), waiting.end(),
                                       [&](int i, int j) { return graph.fill(i) < graph.fill(j); });
    done.order.push_back(*best);
    done.left.push_back(graph.eliminate(*best));
    waiting.erase(best);
  }
  return done;
}

/// Columns of a row that follow each other.
struct Stretch {
  int begin, length;
};

/// Stretches of row k of a structure to the right of the diagonal.
std::vector<Stretch> stretches(const std::vector<char>& row, int k) {
  std::vector<Stretch> list;
  for (int j = k + 1; j < static_cast<int>(row.size()); ++j) {
    if (!row[j]) continue;
    if (list.empty() || list.back().begin + list.back().length != j) list.push_back({j, 0});
    ++list.back().length;
  }
  return list;
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

  const Elimination done = minimum_fill(s);
  p.permutation = done.order;
  std::vector<int> step_of(nv);
  for (int k = 0; k < nv; ++k) step_of[p.permutation[k]] = k;
  // Structure in elimination order, with fill.
  Structure f(nv, std::vector<char>(nv, 0));
  for (int k = 0; k < nv; ++k) {
    f[k][k] = 1;
    for (const int j : done.left[k]) f[k][step_of[j]] = f[step_of[j]][k] = 1;
  }
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
    // Row i has every column that row k has: what is one stretch of k is one of i.
    const std::vector<Stretch> columns = stretches(f[k], k);
    for (int i = k + 1; i < nv; ++i) {
      if (!f[i][k]) continue;
      p.lower_slot.push_back(slot(i, k));
      p.run_begin.push_back(static_cast<int>(p.runs.size()));
      bool open = false;
      for (const Stretch& c : columns) {
        open = open && slot(i, c.begin) == p.runs.back().target + p.runs.back().length;
        if (!open) p.runs.push_back({slot(k, c.begin), slot(i, c.begin), 0});
        open = true;
        p.runs.back().length += c.length;
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
