// SPDX-License-Identifier: Apache-2.0
// Factors of scenes of many trees, lane by lane: the elimination order and the fill of a lane
// follow from the contacts that push in it (kernels/step/block_lu.hpp), so they do not depend on
// its neighbours.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/base/aligned.hpp"
#include "kernels/step/block_lu_types.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

/// Where a group stores the blocks of A: those of every tree, then those of trees that some lane's
/// candidates couple.
class BlockEntries {
 public:
  struct Block {
    int row, column;  ///< trees
    int first;        ///< entry of A, row by row
  };

  /// Takes out all blocks but those of trees.
  void reset(const kernels::Pattern& pattern);
  /// Adds the blocks that couple two trees, unless they are there.
  void couple(const kernels::Pattern& pattern, int tree1, int tree2);

  /// Returns the entry of A in row i, column j; -1: it is not stored.
  [[nodiscard]] int entry(const kernels::Pattern& pattern, int i, int j) const;
  /// (trees, trees) first entry of each block, -1 where there is none.
  [[nodiscard]] const int* first() const { return first_.data(); }
  [[nodiscard]] int entries() const { return entries_; }
  /// Blocks (t1, t2) with t1 > t2, each followed by (t2, t1).
  [[nodiscard]] const std::vector<Block>& coupling() const { return coupling_; }

 private:
  std::vector<int> first_;  ///< (trees, trees); -1: no block
  std::vector<Block> coupling_;
  int entries_ = 0;
};

/// LU of every lane.
class BlockFactors {
 public:
  BlockFactors(const kernels::Pattern& pattern, int lanes);
  ~BlockFactors();
  BlockFactors(BlockFactors&&) noexcept;
  BlockFactors& operator=(BlockFactors&&) noexcept;

  /// Factors the matrix of a lane whose entries are A.
  template <int L>
  void factor(const kernels::KernelTable& table, const kernels::Pattern& pattern,
              const BlockEntries& entries, const kernels::Row<L>* A, int lane);
  /// Solves lane `lane` of `out`, (n), from that of `b`, by its latest factor.
  template <int L>
  void solve(const kernels::KernelTable& table, int lane, const kernels::Row<L>* b,
             kernels::Row<L>* out);
  /// The same, refined once. Returns whether the result can be trusted.
  template <int L>
  [[nodiscard]] bool solve_watched(const kernels::KernelTable& table, bool transposed, int lane,
                                   const kernels::Row<L>* b, kernels::Row<L>* out);

 private:
  struct Lane;
  std::vector<std::unique_ptr<Lane>> lanes_;
};

}  // namespace tangere
