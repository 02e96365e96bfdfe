// SPDX-License-Identifier: Apache-2.0
// Dry friction of a dof: a spring that slips. With the coordinate z at which it is slack, the
// elastic displacement s = q - z and the strain y = (s + t_f v)/θ_b,
//
//   f = -τ clip(y, ±1)          sticks where |y| ≤ 1, with stiffness τ/θ_b and damping τ t_f/θ_b
//
// z follows from the last accepted state, z = q₀ - s₀. When a step is accepted, s' = s/max(1, |y|).
#pragma once

#include "kernels/step/stage.hpp"

namespace tangere::kernels {

template <class N>
struct DryFriction {
  N share;  ///< -f/τ, from -1 to 1
  N hold;   ///< 1/max(1, |y|)
  N rigid;  ///< 1 where it sticks, else 0
};

/// Computes the law at q and v of a dof with the anchor z.
template <class N>
DryFriction<N> dry_friction(const DofEffects& e, const N& q, const N& v, const N& z) {
  const N y = N(e.friction_rate) * mul_add(N(e.friction_time), v, q - z), size = abs(y), one(1.0);
  const auto slips = one < size;
  const N hold = select(slips, one / select(slips, size, one), one);
  return {select(slips, select(y < N(0.0), -one, one), y), hold, select(slips, N(0.0), one)};
}

}  // namespace tangere::kernels
