// SPDX-License-Identifier: Apache-2.0
// Symbolic analysis of the Jacobian, once per scene: which entries exist, in which order dofs are
// eliminated, and which entries fill in.
#pragma once

#include <utility>
#include <vector>

#include "kernels/step/model_view.hpp"

namespace tangere {

/// The storage behind kernels::PatternPart.
struct PatternPartStorage {
  std::vector<int> entry_first, entry_end, factor_first, factor_end;
  std::vector<int> lower_begin, lower_slot, run_begin;
  std::vector<kernels::EliminationRun> runs;
  [[nodiscard]] kernels::PatternPart view() const;
};

/// The storage behind kernels::Pattern.
struct PatternStorage {
  int n = 0, entries = 0, assembled = 0, factor_entries = 0;
  std::vector<int> diagonal_entry, tree, tree_dof, ordinals;
  std::vector<int> slot, entry_column, permutation, scatter, diagonal;
  std::vector<int> row_begin, factor_column;
  std::vector<kernels::FoldedEntry> folded;  ///< of dofs that follow others
  std::vector<kernels::SlopedEntry> sloped;  ///< of rows of those that follow by polynomials
  PatternPartStorage whole, apart;
  [[nodiscard]] kernels::Pattern view() const;
};

/// A symmetric structure: row by row, not 0 where there is an entry.
using Structure = std::vector<std::vector<char>>;

/// The dofs that follow others.
struct FollowingDofs {
  std::vector<kernels::FollowerTie> ties{};
  std::vector<kernels::PolynomialFollower> polynomials{};
};

/// Eliminates at every step the index that creates fewest new entries; the lowest on ties. Returns
/// the order.
std::vector<int> minimum_fill(const Structure& s);

/// Finds a minimum-fill elimination of the structure that the tree, all contacts, the dofs that
/// follow others, loops and transmissions make. `closed`: the links of loops, which couple without
/// touching. `driven`: the dofs of each transmission.
PatternStorage analyse_pattern(const std::vector<kernels::Link>& links, int nv,
                               const std::vector<std::pair<int, int>>& touching,
                               const FollowingDofs& following = {},
                               const std::vector<kernels::Loop>& closed = {},
                               const std::vector<std::vector<int>>& driven = {});

/// Returns the pattern in blocks of trees.
PatternStorage block_pattern(const std::vector<kernels::Link>& links, int nv);

/// Returns whether A should be stored in blocks: contacts are declared between so many trees that a
/// pattern of all of them has far more entries than those that touch at a time.
bool prefers_blocks(const std::vector<kernels::Link>& links,
                    const std::vector<std::pair<int, int>>& touching);

}  // namespace tangere
