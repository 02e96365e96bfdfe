// SPDX-License-Identifier: Apache-2.0
// Pulls cotangents of the relative motion of two bodies back to their links, in one lane:
//   δ̄₂ = Adᵀ ε̄, δ̄₁ = -ε̄, V̄₂ = Adᵀ W̄, V̄₁ = -W̄  (engine/derivative/readout_pullback.cpp)
#pragma once

#include "kernels/numbers/lanes.hpp"
#include "kernels/step/arguments.hpp"

namespace tangere {

template <int L>
void add_to_lane(kernels::Vec6<kernels::Row<L>>& to, const kernels::Vec6<double>& x, int lane,
                 double sign) {
  auto* const rows = &to.a.x;
  const double* const from = &x.a.x;
  for (int i = 0; i < 6; ++i) rows[i][lane] += sign * from[i];
}

/// `pose` and `twist`: ε̄ and W̄ in the axes and about the origin of link 1. `link1`, `link2`: null
/// for the world.
template <int L>
void hand_on_to_links(const kernels::Frame<double>& link2_in_1, const kernels::Vec6<double>& pose,
                      const kernels::Vec6<double>& twist, int lane,
                      kernels::MotionCotangent<kernels::Row<L>>* link1,
                      kernels::MotionCotangent<kernels::Row<L>>* link2) {
  if (link1 != nullptr) {
    add_to_lane<L>(link1->pose, pose, lane, -1);
    add_to_lane<L>(link1->twist, twist, lane, -1);
  }
  if (link2 != nullptr) {
    add_to_lane<L>(link2->pose, wrench_to_child(link2_in_1, pose), lane, 1);
    add_to_lane<L>(link2->twist, wrench_to_child(link2_in_1, twist), lane, 1);
  }
}

}  // namespace tangere
