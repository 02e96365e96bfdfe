// SPDX-License-Identifier: Apache-2.0
// Finds a greedy elimination order, then runs of factor entries that one loop can process.
#include "engine/model/pattern.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>

namespace tangere {

namespace {

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

/// A symmetric structure as a graph of dofs, each with a row of bits: its neighbours.
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

  /// Connects all neighbours of p with each other and takes p out. Counts are changed, not counted
  /// anew: that would be cubic.
  void eliminate(int p) {
    const std::vector<int> around = neighbours(p);
    for (std::size_t k = 0; k < around.size() && fill_[p] > 0; ++k)
      for (std::size_t l = k + 1; l < around.size(); ++l)
        if (!has(around[k], around[l])) connect(around[k], around[l]);
    for (const int i : around) {
      fill_[i] -= beyond(i, p) - 1;
      row(i)[p / 64] &= ~(std::uint64_t{1} << (p % 64));
    }
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

}  // namespace

std::vector<int> minimum_fill(const Structure& s) {
  Graph graph(s);
  std::vector<int> order;
  std::vector<int> remaining(s.size());
  std::iota(remaining.begin(), remaining.end(), 0);
  while (!remaining.empty()) {
    const auto best = std::min_element(remaining.begin(), remaining.end(),
                                       [&](int i, int j) { return graph.fill(i) < graph.fill(j); });
    order.push_back(*best);
    graph.eliminate(*best);
    remaining.erase(best);
  }
  return order;
}

namespace {

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

/// Where an entry of a matrix over n dofs is stored; -1 where it is not.
using Slots = std::vector<int>;

/// Returns the rows and columns of a structure in elimination order.
Structure permuted(const Structure& s, const std::vector<int>& order) {
  Structure f(s.size(), std::vector<char>(s.size(), 0));
  for (std::size_t i = 0; i < s.size(); ++i)
    for (std::size_t j = 0; j < s.size(); ++j)
      f[i][j] = s[std::size_t(order[i])][std::size_t(order[j])];
  return f;
}

/// Adds what elimination from the first row to the last fills in.
void fill_in(Structure& f) {
  for (std::size_t k = 0; k < f.size(); ++k)
    for (std::size_t i = k + 1; i < f.size(); ++i)
      for (std::size_t j = k + 1; f[i][k] != 0 && j < f.size(); ++j)
        if (f[k][j] != 0) f[i][j] = 1;
}

/// Appends the slots between which row i of a structure lies: its first, and one past its last. A
/// row has at least its diagonal.
void add_extent(const Structure& s, int i, const Slots& at, std::vector<int>& first,
                std::vector<int>& end) {
  const int n = static_cast<int>(s.size());
  int low = -1, high = -1;
  for (int j = 0; j < n; ++j) {
    if (!s[i][j]) continue;
    high = at[std::size_t(i) * n + j];
    if (low < 0) low = high;
  }
  first.push_back(low);
  end.push_back(high + 1);
}

/// Returns the part of a pattern that holds a structure, in dof order, and its fill, in elimination
/// order. `at`: the slots of the whole pattern's factor.
PatternPartStorage part_of(const Structure& s, const Structure& f, const PatternStorage& p,
                           const Slots& at) {
  PatternPartStorage part;
  for (int i = 0; i < p.n; ++i) {
    add_extent(s, i, p.slot, part.entry_first, part.entry_end);
    add_extent(f, i, at, part.factor_first, part.factor_end);
    part.factor_first.back() -= (part.factor_first.back() - p.row_begin[i]) % 2;
  }
  const auto slot = [&](int i, int j) { return at[std::size_t(i) * p.n + j]; };
  for (int k = 0; k < p.n; ++k) {
    part.lower_begin.push_back(static_cast<int>(part.lower_slot.size()));
    // Row i has every column that row k has: what is one stretch of k is one of i.
    const std::vector<Stretch> columns = stretches(f[k], k);
    for (int i = k + 1; i < p.n; ++i) {
      if (!f[i][k]) continue;
      part.lower_slot.push_back(slot(i, k));
      part.run_begin.push_back(static_cast<int>(part.runs.size()));
      bool open = false;
      for (const Stretch& c : columns) {
        open = open && slot(i, c.begin) == part.runs.back().target + part.runs.back().length;
        if (!open) part.runs.push_back({slot(k, c.begin), slot(i, c.begin), 0});
        open = true;
        part.runs.back().length += c.length;
      }
    }
  }
  part.lower_begin.push_back(static_cast<int>(part.lower_slot.size()));
  part.run_begin.push_back(static_cast<int>(part.runs.size()));
  return part;
}

}  // namespace

namespace {

/// Of more pairs of trees with contacts than this for each tree, most cannot touch at the same
/// time: a box in a pile touches about six others.
constexpr int kMostPairsOfTree = 4;

/// Returns the first dof of every tree, then their number.
std::vector<int> first_dofs(const std::vector<kernels::Link>& links) {
  std::vector<int> first;
  int end = 0;
  for (const kernels::Link& link : links) {
    if (link.parent < 0) first.push_back(link.v);
    end = link.v + kernels::dofs(link.kind);
  }
  first.push_back(end);
  return first;
}

}  // namespace

namespace {

/// The free dofs in whose terms a dof is, with their ratios: itself if it follows none. Columns of
/// one that follows by a polynomial have the ratio 1.
using FreeDofs = std::vector<std::vector<std::pair<int, double>>>;

FreeDofs free_dofs(int nv, const FollowingDofs& following) {
  FreeDofs out(static_cast<std::size_t>(nv));
  for (const kernels::FollowerTie& t : following.ties)
    out[std::size_t(t.v)].emplace_back(t.leader_v, t.ratio);
  for (const kernels::PolynomialFollower& f : following.polynomials)
    out[std::size_t(f.v)].emplace_back(f.leader_v, 1.0);
  for (int i = 0; i < nv; ++i)
    if (out[std::size_t(i)].empty()) out[std::size_t(i)].emplace_back(i, 1.0);
  return out;
}

bool is_free(const FreeDofs& of, int i) { return of[std::size_t(i)].front().first == i; }

/// The structure of Gᵀ A G, where followers keep a diagonal entry.
Structure folded(const Structure& s, const FreeDofs& free) {
  Structure out(s.size(), std::vector<char>(s.size(), 0));
  for (std::size_t i = 0; i < s.size(); ++i) {
    out[i][i] = 1;
    for (std::size_t j = 0; j < s.size(); ++j)
      for (const auto& [row, row_ratio] : free[i])
        for (const auto& [column, column_ratio] : free[j])
          if (s[i][j] != 0) out[std::size_t(row)][std::size_t(column)] = 1;
  }
  return out;
}

/// Numbers the entries of `written` that the solved structure does not have, after those that it
/// has, and lists what they, and entries of followers, add to others.
void fold_entries(PatternStorage& p, const Structure& written, const FreeDofs& free,
                  const std::vector<kernels::PolynomialFollower>& polynomials) {
  const auto polynomial_of = [&](int i) {
    const auto of = std::ranges::find(polynomials, i, &kernels::PolynomialFollower::v);
    return of == polynomials.end() ? -1 : static_cast<int>(of - polynomials.begin());
  };
  p.assembled = p.entries;
  const auto at = [&](int i, int j) -> int& { return p.slot[std::size_t(i) * p.n + j]; };
  for (int i = 0; i < p.n; ++i) {
    const int polynomial = polynomial_of(i);
    for (int j = 0; j < p.n; ++j) {
      if (!written[i][j] || (is_free(free, i) && is_free(free, j))) continue;
      if (at(i, j) < 0) at(i, j) = p.assembled++;
      for (const auto& [row, row_ratio] : free[std::size_t(i)])
        for (const auto& [column, column_ratio] : free[std::size_t(j)]) {
          const int target = at(row, column), source = at(i, j);
          if (polynomial < 0)
            p.folded.push_back({target, source, row_ratio * column_ratio});
          else
            p.sloped.push_back({target, source, column_ratio, polynomial});
        }
    }
  }
}

}  // namespace

PatternStorage analyse_pattern(const std::vector<kernels::Link>& links, int nv,
                               const std::vector<std::pair<int, int>>& touching,
                               const FollowingDofs& following,
                               const std::vector<kernels::Loop>& closed,
                               const std::vector<std::vector<int>>& driven) {
  Structure alone(nv, std::vector<char>(nv, 0));
  for (int i = 0; i < static_cast<int>(links.size()); ++i) couple(alone, support(links, i));
  const auto couple_links = [&](Structure& of, int first, int second) {
    std::vector<int> both = support(links, first);
    const std::vector<int> other = support(links, second);
    both.insert(both.end(), other.begin(), other.end());
    couple(of, both);
  };
  for (const kernels::Loop& loop : closed) couple_links(alone, loop.link1, loop.link2);
  for (const std::vector<int>& dofs : driven) couple(alone, dofs);
  Structure s = alone;
  for (const auto& [first, second] : touching) couple_links(s, first, second);
  const Structure written = s;
  const FreeDofs free = free_dofs(nv, following);
  if (!following.ties.empty() || !following.polynomials.empty())
    s = folded(s, free), alone = folded(alone, free);

  PatternStorage p;
  p.n = nv;
  p.slot.assign(std::size_t(nv) * nv, -1);
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < nv; ++j) {
      if (!s[i][j]) continue;
      p.slot[std::size_t(i) * nv + j] = p.entries++;
      p.entry_column.push_back(j);
    }

  for (int i = 0; i < nv; ++i) p.diagonal_entry.push_back(p.slot[std::size_t(i) * (nv + 1)]);

  p.permutation = minimum_fill(s);
  Structure f = permuted(s, p.permutation), fill_alone = permuted(alone, p.permutation);
  fill_in(f);
  fill_in(fill_alone);
  Slots at(std::size_t(nv) * nv, -1);
  for (int i = 0; i < nv; ++i) {
    p.row_begin.push_back(p.factor_entries);
    for (int j = 0; j < nv; ++j) {
      if (!f[i][j]) continue;
      at[std::size_t(i) * nv + j] = p.factor_entries++;
      p.factor_column.push_back(j);
    }
    p.diagonal.push_back(at[std::size_t(i) * nv + i]);
  }
  p.scatter.resize(p.entries);
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < nv; ++j) {
      const int entry = p.slot[std::size_t(p.permutation[i]) * nv + p.permutation[j]];
      if (entry >= 0) p.scatter[entry] = at[std::size_t(i) * nv + j];
    }
  p.whole = part_of(s, f, p, at);
  p.apart = part_of(alone, fill_alone, p, at);
  fold_entries(p, written, free, following.polynomials);
  return p;
}

PatternStorage block_pattern(const std::vector<kernels::Link>& links, int nv) {
  PatternStorage p;
  p.n = nv;
  p.tree_dof = first_dofs(links);
  const int trees = static_cast<int>(p.tree_dof.size()) - 1;
  int largest = 0;
  for (int t = 0; t < trees; ++t) {
    const int size = p.tree_dof[t + 1] - p.tree_dof[t];
    for (int i = 0; i < size; ++i) {
      p.tree.push_back(t);
      p.diagonal_entry.push_back(p.entries + i * (size + 1));
    }
    p.entries += size * size;
    largest = std::max(largest, size);
  }
  p.assembled = p.factor_entries = p.entries;
  p.ordinals.resize(std::size_t(largest) * largest);
  std::iota(p.ordinals.begin(), p.ordinals.end(), 0);
  return p;
}

bool prefers_blocks(const std::vector<kernels::Link>& links,
                    const std::vector<std::pair<int, int>>& touching) {
  std::vector<int> root(links.size());
  for (std::size_t i = 0; i < links.size(); ++i) {
    root[i] = links[i].parent < 0 ? static_cast<int>(i) : root[std::size_t(links[i].parent)];
    if (i > 0 && root[i] < root[i - 1]) return false;  // dofs of a tree are not adjacent
  }
  std::vector<std::pair<int, int>> coupled;
  for (const auto& [first, second] : touching) {
    if (first < 0 || second < 0) continue;
    const int a = root[std::size_t(first)], b = root[std::size_t(second)];
    if (a != b) coupled.emplace_back(std::min(a, b), std::max(a, b));
  }
  std::sort(coupled.begin(), coupled.end());
  const auto distinct = std::unique(coupled.begin(), coupled.end()) - coupled.begin();
  const auto trees = std::count_if(links.begin(), links.end(),
                                   [](const kernels::Link& link) { return link.parent < 0; });
  return distinct > kMostPairsOfTree * trees;
}

kernels::PatternPart PatternPartStorage::view() const {
  return {entry_first.data(), entry_end.data(),  factor_first.data(), factor_end.data(),
          lower_begin.data(), lower_slot.data(), run_begin.data(),    runs.data()};
}

kernels::Pattern PatternStorage::view() const {
  return {n,
          entries,
          assembled,
          diagonal_entry.data(),
          tree_dof.empty() ? 0 : static_cast<int>(tree_dof.size()) - 1,
          tree.data(),
          tree_dof.data(),
          ordinals.data(),
          slot.empty() ? nullptr : slot.data(),
          entry_column.data(),
          factor_entries,
          permutation.data(),
          scatter.data(),
          row_begin.data(),
          diagonal.data(),
          factor_column.data(),
          whole.view(),
          apart.view()};
}

}  // namespace tangere
