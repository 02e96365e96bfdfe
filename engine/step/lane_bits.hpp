// SPDX-License-Identifier: Apache-2.0
// Sets of lanes of a group.
#pragma once

#include <cstring>

#include "kernels/numbers/lanes.hpp"

namespace tangere {

/// Bit l: lane l of the group.
using LaneBits = unsigned;
inline constexpr LaneBits kNoLane = 0;
inline constexpr LaneBits kAllLanes = (1U << kernels::kGroup) - 1;
inline bool has(LaneBits bits, int lane) { return ((bits >> lane) & 1U) != 0; }

/// Copies the numbers of some lanes of a row. All of them are one vector.
template <int L>
inline void put_lanes(const double* from, LaneBits lanes, double* to) {
  if (lanes == (1U << L) - 1) {
    std::memcpy(to, from, L * sizeof(double));
    return;
  }
  for (int l = 0; l < L; ++l)
    if (has(lanes, l)) to[l] = from[l];
}

}  // namespace tangere
