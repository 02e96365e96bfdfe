// SPDX-License-Identifier: Apache-2.0
// Checks of the state at the end of whole steps: bodies of a contact that passed through each other
// over any number of steps, and bodies that overlap deeper than any contact point.
#pragma once

#include <vector>

#include "engine/step/batch.hpp"
#include "engine/step/tunnelling_check.hpp"
#include "engine/step/workspace.hpp"

namespace tangere {

/// The share of the smaller body's inscribed radius that the radius of the largest ball in both
/// bodies must exceed for them to count as overlapping: they are then a quarter of its thickness
/// inside each other.
inline constexpr double kOverlapShare = 0.25;

/// Scratch of one thread. A state is checked only if bodies have moved farther since the last check
/// than the clearance that it found, to an overlap or a change of sides (stored in Batch).
class Interpenetration {
 public:
  explicit Interpenetration(const CompiledModel& model);

  /// Whether the model has a pair of bodies to check.
  [[nodiscard]] bool has_pairs() const { return has_pairs_; }

  /// Returns for L lanes no less than what any point of a checked body moved relative to another in
  /// the last step [m]. `rows`: number r of lane l at [r * kBlock + l]. They hold the states before
  /// and after that step.
  template <int L>
  [[nodiscard]] kernels::Row<L> motions(const double* rows);

  /// Result of a check, and the distance that bodies may move until the next one [m].
  struct Finding {
    bool tunnelled = false, overlapping = false;
    double clearance = 0;
  };
  /// Checks one lane. `column`: its numbers in the block. `motion`: its number of motions().
  /// Overwrites states, poses and block of the workspace.
  [[nodiscard]] Finding check(const kernels::KernelTable& table, SingleWorkspace& w,
                              const double* column, double motion) const;

 private:
  /// Two bodies whose contact points are far apart (engine/scene/contact_resolution.hpp).
  struct CoarsePair {
    int body1, body2;
    std::vector<int> contacts;  ///< of these bodies, in either direction: indices of pairs
  };
  class Lane;

  void bound_arms();
  [[nodiscard]] double arm_ratio(const double* column) const;

  const CompiledModel& model_;
  TunnellingCheck passing_;
  std::vector<CoarsePair> coarse_;
  bool has_pairs_ = false;
  std::vector<double> arm_;            ///< (links) from its origin to any point that it moves [m]
  std::vector<std::uint8_t> checked_;  ///< (links) 1: carries a body that is checked
  std::vector<int> sliders_;           ///< in q: sliding dofs of links that others turn
  AlignedVector<double> way_;          ///< (links, kGroup) scratch
};

}  // namespace tangere
