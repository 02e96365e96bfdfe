// SPDX-License-Identifier: Apache-2.0
// The plan of a lane is computed when the set of its blocks that are not zero changes.
#include "engine/step/block_factors.hpp"

#include <algorithm>
#include <utility>

#include "engine/model/pattern.hpp"

namespace tangere {

using kernels::BlockNode;
using kernels::EliminatedBlock;
using kernels::MatrixBlock;
using kernels::Pattern;
using kernels::Row;

namespace {

int size_of(const Pattern& p, int tree) { return p.tree_dof[tree + 1] - p.tree_dof[tree]; }

}  // namespace

void BlockEntries::reset(const Pattern& p) {
  const std::size_t trees = std::size_t(p.n_trees);
  if (first_.size() != trees * trees) {
    first_.assign(trees * trees, -1);
    for (int t = 0, at = 0; t < p.n_trees; at += size_of(p, t) * size_of(p, t), ++t)
      first_[std::size_t(t) * (trees + 1)] = at;
  }
  for (const Block& b : coupling_) first_[std::size_t(b.row) * trees + std::size_t(b.column)] = -1;
  coupling_.clear();
  entries_ = p.entries;
}

void BlockEntries::couple(const Pattern& p, int tree1, int tree2) {
  const std::size_t trees = std::size_t(p.n_trees);
  const int high = std::max(tree1, tree2), low = std::min(tree1, tree2);
  if (high == low || first_[std::size_t(high) * trees + std::size_t(low)] >= 0) return;
  const int count = size_of(p, high) * size_of(p, low);
  for (const auto& [row, column] : {std::pair{high, low}, std::pair{low, high}}) {
    first_[std::size_t(row) * trees + std::size_t(column)] = entries_;
    coupling_.push_back({row, column, entries_});
    entries_ += count;
  }
}

int BlockEntries::entry(const Pattern& p, int i, int j) const {
  const int row = p.tree[i], column = p.tree[j],
            first = first_[std::size_t(row * p.n_trees + column)];
  return first < 0 ? -1
                   : first + (i - p.tree_dof[row]) * size_of(p, column) + j - p.tree_dof[column];
}

/// Plan and numbers of one lane.
struct BlockFactors::Lane {
  Structure coupled, present;  // (trees, trees) of the present plan; of the matrix to factor
  std::vector<int> order;      // elimination step → tree
  std::vector<BlockNode> nodes;
  std::vector<std::size_t> diagonal, targets;
  std::vector<int> begin;
  std::vector<EliminatedBlock> eliminated;
  std::vector<MatrixBlock> blocks;
  kernels::BlockPlan plan{};
  AlignedVector<double> matrix, factor, b, x, work;

  void make_plan(const Pattern& p);
  void order_nodes(const Pattern& p);
  void fill();
  [[nodiscard]] std::size_t block_at(int i, int j) const;
  void view();
};

void BlockFactors::Lane::order_nodes(const Pattern& p) {
  order = minimum_fill(coupled);
  nodes.clear();
  std::size_t at = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const int size = size_of(p, order[k]), padded = kernels::padded_to_vectors(size);
    nodes.push_back({p.tree_dof[order[k]], size, padded, at});
    at += std::size_t(padded);
  }
  plan.vector = at;
}

/// Finds the blocks of the factor. The nodes that pivot k couples, beyond the first of them, are
/// coupled with that first one (its parent in the elimination tree).
void BlockFactors::Lane::fill() {
  const int n = static_cast<int>(nodes.size());
  std::vector<std::vector<int>> later(nodes.size());
  std::size_t at = 0;
  diagonal.clear();
  eliminated.clear();
  begin.assign(1, 0);
  for (int k = 0; k < n; ++k) {
    std::vector<int>& after = later[std::size_t(k)];
    const std::vector<char>& row = coupled[std::size_t(order[std::size_t(k)])];
    for (int i = k + 1; i < n; ++i)
      if (row[std::size_t(order[std::size_t(i)])] != 0) after.push_back(i);
    std::sort(after.begin(), after.end());
    after.erase(std::unique(after.begin(), after.end()), after.end());
    if (after.size() > 1) {
      std::vector<int>& parent = later[std::size_t(after.front())];
      parent.insert(parent.end(), after.begin() + 1, after.end());
    }
    const auto take = [&](const BlockNode& rows, const BlockNode& columns) {
      return std::exchange(at, at + std::size_t(rows.padded) * std::size_t(columns.size));
    };
    const BlockNode& node = nodes[std::size_t(k)];
    diagonal.push_back(take(node, node));
    for (const int i : after) {
      const BlockNode& other = nodes[std::size_t(i)];
      const std::size_t l = take(other, node);
      eliminated.push_back({i, l, take(node, other)});
    }
    begin.push_back(static_cast<int>(eliminated.size()));
  }
  plan.numbers = at;
}

/// Returns the first number of block (i, j), in elimination order.
std::size_t BlockFactors::Lane::block_at(int i, int j) const {
  if (i == j) return diagonal[std::size_t(i)];
  const int pivot = std::min(i, j), later = std::max(i, j);
  const auto end = eliminated.begin() + begin[std::size_t(pivot) + 1];
  const auto found =
      std::lower_bound(eliminated.begin() + begin[std::size_t(pivot)], end, later,
                       [](const EliminatedBlock& e, int node) { return e.node < node; });
  return i > j ? found->l : found->u;
}

void BlockFactors::Lane::make_plan(const Pattern& p) {
  order_nodes(p);
  fill();
  targets.clear();
  blocks.clear();
  for (int k = 0; k < p.n_trees; ++k) {
    blocks.push_back({k, k, diagonal[std::size_t(k)]});
    const EliminatedBlock *first = eliminated.data() + begin[std::size_t(k)],
                          *end = eliminated.data() + begin[std::size_t(k) + 1];
    for (const EliminatedBlock* i = first; i != end; ++i) {
      for (const EliminatedBlock* j = first; j != end; ++j)
        targets.push_back(block_at(i->node, j->node));
      if (coupled[std::size_t(order[std::size_t(k)])][std::size_t(order[std::size_t(i->node)])] ==
          0)
        continue;
      blocks.push_back({i->node, k, i->l});
      blocks.push_back({k, i->node, i->u});
    }
  }
  view();
}

void BlockFactors::Lane::view() {
  std::size_t largest = 0;
  for (const BlockNode& node : nodes) largest = std::max(largest, std::size_t(node.padded));
  matrix.assign(plan.numbers, 0);
  factor.resize(plan.numbers);
  b.assign(plan.vector, 0);
  x.assign(plan.vector, 0);
  work.resize(5 * plan.vector + largest * largest);
  plan = {static_cast<int>(nodes.size()),
          nodes.data(),
          plan.vector,
          plan.numbers,
          diagonal.data(),
          begin.data(),
          eliminated.data(),
          targets.data(),
          static_cast<int>(blocks.size()),
          blocks.data()};
}

BlockFactors::BlockFactors(const Pattern& p, int lanes) {
  for (int l = 0; l < lanes && p.slot == nullptr; ++l) lanes_.push_back(std::make_unique<Lane>());
}
BlockFactors::~BlockFactors() = default;
BlockFactors::BlockFactors(BlockFactors&&) noexcept = default;
BlockFactors& BlockFactors::operator=(BlockFactors&&) noexcept = default;

namespace {

template <int L>
bool is_zero(const Row<L>* entries, int count, int lane) {
  for (int e = 0; e < count; ++e)
    if (entries[e][lane] != 0) return false;
  return true;
}

/// Finds which trees are coupled in a lane.
template <int L>
void find_coupled(const Pattern& p, const BlockEntries& entries, const Row<L>* A, int lane,
                  Structure& found) {
  found.resize(std::size_t(p.n_trees));
  for (std::vector<char>& row : found) row.assign(std::size_t(p.n_trees), 0);
  for (std::size_t k = 0; k < entries.coupling().size(); k += 2) {
    const BlockEntries::Block& block = entries.coupling()[k];
    const int count = size_of(p, block.row) * size_of(p, block.column);
    if (is_zero<L>(A + block.first, 2 * count, lane)) continue;
    found[std::size_t(block.row)][std::size_t(block.column)] = 1;
    found[std::size_t(block.column)][std::size_t(block.row)] = 1;
  }
}

}  // namespace

template <int L>
void BlockFactors::factor(const kernels::KernelTable& table, const Pattern& p,
                          const BlockEntries& entries, const Row<L>* A, int lane) {
  Lane& o = *lanes_[std::size_t(lane)];
  find_coupled<L>(p, entries, A, lane, o.present);
  if (o.present != o.coupled) {
    std::swap(o.present, o.coupled);
    o.make_plan(p);
  }
  for (const MatrixBlock& block : o.blocks) {
    const int row = o.order[std::size_t(block.row)], column = o.order[std::size_t(block.column)];
    const BlockNode &rows = o.nodes[std::size_t(block.row)],
                    &columns = o.nodes[std::size_t(block.column)];
    const Row<L>* from = A + entries.first()[row * p.n_trees + column];
    double* to = o.matrix.data() + block.at;
    for (int i = 0; i < rows.size; ++i)
      for (int j = 0; j < columns.size; ++j)
        to[j * rows.padded + i] = from[i * columns.size + j][lane];
  }
  std::copy(o.matrix.begin(), o.matrix.end(), o.factor.begin());
  table.factor_blocks(o.plan, o.factor.data(), o.work.data());
}

namespace {

template <int L>
void load(const std::vector<BlockNode>& nodes, const Row<L>* rows, int lane, double* to) {
  for (const BlockNode& node : nodes)
    for (int i = 0; i < node.size; ++i) to[node.at + std::size_t(i)] = rows[node.dof + i][lane];
}
template <int L>
void store(const std::vector<BlockNode>& nodes, const double* from, int lane, Row<L>* rows) {
  for (const BlockNode& node : nodes)
    for (int i = 0; i < node.size; ++i) rows[node.dof + i][lane] = from[node.at + std::size_t(i)];
}

}  // namespace

template <int L>
void BlockFactors::solve(const kernels::KernelTable& table, int lane, const Row<L>* b,
                         Row<L>* out) {
  Lane& o = *lanes_[std::size_t(lane)];
  load<L>(o.nodes, b, lane, o.x.data());
  table.solve_blocks(o.plan, o.factor.data(), o.x.data(), o.x.data(), o.work.data());
  store<L>(o.nodes, o.x.data(), lane, out);
}

template <int L>
bool BlockFactors::solve_watched(const kernels::KernelTable& table, bool transposed, int lane,
                                 const Row<L>* b, Row<L>* out) {
  Lane& o = *lanes_[std::size_t(lane)];
  load<L>(o.nodes, b, lane, o.b.data());
  const bool sound = (transposed ? table.solve_blocks_transposed : table.solve_blocks_watched)(
      o.plan, o.matrix.data(), o.factor.data(), o.b.data(), o.x.data(), o.work.data());
  store<L>(o.nodes, o.x.data(), lane, out);
  return sound;
}

#define TANGERE_FOR_LANES(L)                                                                       \
  template void BlockFactors::factor(const kernels::KernelTable&, const Pattern&,                  \
                                     const BlockEntries&, const Row<L>*, int);                     \
  template void BlockFactors::solve(const kernels::KernelTable&, int, const Row<L>*, Row<L>*);     \
  template bool BlockFactors::solve_watched(const kernels::KernelTable&, bool, int, const Row<L>*, \
                                            Row<L>*);
TANGERE_FOR_LANES(1)
TANGERE_FOR_LANES(kernels::kGroup)
#undef TANGERE_FOR_LANES

}  // namespace tangere
