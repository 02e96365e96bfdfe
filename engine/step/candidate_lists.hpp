// SPDX-License-Identifier: Apache-2.0
// Lists of contact candidates of a group of eight lanes, or of a single lane, and the poses, sizes
// and faces at which they were made. The lists of a lane are valid as long as it has not moved
// farther than their margin from there, and its sizes and faces are the same. So they may be kept
// from one step to the next. Anchors of shear springs are computed anew for every solve.
#pragma once

#include <climits>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/step/lane_bits.hpp"
#include "kernels/step/arguments.hpp"

namespace tangere {

/// Returns a number of points, rounded up to whole vectors, and one vector more: a search that
/// finds so many points writes no more.
inline int stride_of(int points) {
  return (points + kernels::kGroup - 1) / kernels::kGroup * kernels::kGroup + kernels::kGroup;
}
inline int search_stride(const kernels::PairContact& pair) { return stride_of(pair.n_points); }

template <int L>
class CandidateLists {
 public:
  using List = typename kernels::Stage<L>::List;

  explicit CandidateLists(const CompiledModel& model);
  CandidateLists(const CandidateLists&) = delete;
  CandidateLists& operator=(const CandidateLists&) = delete;

  /// Makes room for `points` candidates of a pair in every lane. Keeps what is listed; rows must be
  /// made again if it grows.
  void reserve(const CompiledModel& model, std::size_t pair, int points);
  /// Empties the lists of `lanes`, which have none then.
  void clear(LaneBits lanes);
  /// Marks the anchors of all lists as those of an earlier solve. They are computed anew before
  /// use.
  void drop_anchors();
  /// Returns the bytes of the lists of a scene if they hold all points of all pairs, but at most
  /// `most` of two links.
  static std::size_t bytes(const CompiledModel& model, int most = INT_MAX);

  std::vector<List> lists;
  /// (n_link_pairs, 12) poses at which the lists were made.
  AlignedVector<kernels::Row<L>> references;
  /// (n_pairs, 3) faces and sizes with which they were made; of pairs where these vary.
  AlignedVector<kernels::Row<L>> faces, sizes;
  std::vector<unsigned char> apart;         ///< (n_link_pairs) as Stage::apart
  std::vector<unsigned char> apart_before;  ///< the same before the last search
  std::vector<LaneBits> in_rows;            ///< (n_pairs) lanes whose list is also in the rows
  LaneBits all_in_rows = 0;                 ///< lanes of which all lists and anchors are
  /// (n_pairs) lanes in which the points of a pair with shear springs have the anchors of the
  /// present solve, and those of them whose anchors are also in the rows.
  std::vector<LaneBits> anchored, anchors_in_rows;
  LaneBits all_anchored = 0;  ///< lanes in which those of all pairs have them
  LaneBits searched = 0;      ///< lanes that have lists, which may be empty

 private:
  struct Storage {
    AlignedVector<double> numbers;
    std::vector<int> index;
  };
  std::vector<Storage> storage_;  // of each list
};

}  // namespace tangere
