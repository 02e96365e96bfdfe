// SPDX-License-Identifier: Apache-2.0
// Broad phase of scenes of many link pairs: finds, lane by lane, the pairs of links whose balls
// come within reach of each other during a solve. The others cannot touch and cost nothing.
//
// A pair is considered if, where the solve starts, |c₁ - c₂| ≤ r₁ + s₁ + r₂ + s₂, with c the
// centres of the balls, r their radii and s how far each may move in the solve (slack).
// kinematics() reports balls that moved farther; their slack grows, and pairs are found again. So
// pairs that are not considered touch at no point of the solve, and which are considered changes
// no result.
#pragma once

#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/compiled_model.hpp"
#include "kernels/step/arguments.hpp"

namespace tangere {

template <int L>
class BroadPhase {
 public:
  /// Allocates nothing for scenes without link balls.
  explicit BroadPhase(const CompiledModel& model);

  /// Starts a solve: sets the stage's arrays, and every slack.
  void start(kernels::Stage<L>& stage);
  /// Grows the slack of balls that moved beyond it in some of `lanes` (bits). Returns whether some
  /// did.
  bool widen(unsigned lanes);
  /// Finds the pairs that `lanes` consider, from Stage::ball_starts, and sets Stage::considered.
  /// Returns whether some pair was not considered before.
  bool find(unsigned lanes, kernels::Stage<L>& stage);

  [[nodiscard]] const std::vector<int>& added() const { return added_; }
  /// Pairs that the last find() no longer considers.
  [[nodiscard]] const std::vector<int>& dropped() const { return dropped_; }

 private:
  struct Neighbour {
    int link, pair;
  };
  struct Extent {
    double low;
    int link;
  };
  void find_in_lane(int lane);
  void consider(int link1, int link2, int lane);
  void collect();

  const CompiledModel* model_;
  AlignedVector<kernels::Row<L>> starts_, slack_, moves_;
  std::vector<Neighbour> neighbours_;  ///< of all links, sorted by link
  std::vector<int> first_neighbour_;   ///< (n_links + 1)
  std::vector<int> balls_;             ///< links that have a ball
  std::vector<int> always_;            ///< pairs with a link that no ball holds, or with the world
  std::vector<unsigned> lanes_;        ///< (link pairs) lanes that consider a pair
  std::vector<int> considered_, found_, before_, added_, dropped_;
  std::vector<Extent> extents_;
};

}  // namespace tangere
