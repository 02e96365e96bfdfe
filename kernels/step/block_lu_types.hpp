// SPDX-License-Identifier: Apache-2.0
// A matrix over the dofs of one environment in blocks: a node is a tree of links, a block couples
// the dofs of two of them. The elimination order belongs to the blocks that are not zero.
#pragma once

#include "kernels/numbers/block.hpp"

namespace tangere::kernels {

/// Numbers of a node in a vector, and of each column of a block: whole vectors of eight.
constexpr int padded_to_vectors(int size) { return (size + kGroup - 1) / kGroup * kGroup; }

/// The dofs of a tree.
struct BlockNode {
  int dof, size;   ///< first dof, number of dofs
  int padded;      ///< padded_to_vectors(size)
  std::size_t at;  ///< first number in a vector
};

/// A block of A: rows of one node, columns of another.
struct MatrixBlock {
  int row, column;  ///< nodes, in elimination order
  std::size_t at;   ///< first number: column by column, each padded with zeros
};

/// Blocks of a pivot k and a node i that is eliminated after it.
struct EliminatedBlock {
  int node;          ///< i
  std::size_t l, u;  ///< first numbers of L(i, k) and U(k, i)
};

/// Where the numbers of A and of its factors are.
struct BlockPlan {
  int n;                        ///< nodes
  const BlockNode* nodes;       ///< (n) in elimination order
  std::size_t vector, numbers;  ///< numbers of a vector and of all blocks
  const std::size_t* diagonal;  ///< (n) first number of block (k, k)
  const int* begin;             ///< (n + 1) into `eliminated`: those of pivot k
  const EliminatedBlock* eliminated;
  /// Of each pivot with m eliminated blocks, (m, m): first number of the block (i, j) that loses
  /// L(i, k) U(k, j).
  const std::size_t* targets;
  int n_blocks;
  const MatrixBlock* blocks;  ///< (n_blocks) those of A that are not zero
};

}  // namespace tangere::kernels
