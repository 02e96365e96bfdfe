// SPDX-License-Identifier: Apache-2.0
// Penetration depths of the points of a contact.
#pragma once

#include "engine/sense/pad_reader.hpp"

namespace tangere {

/// Of the points of one contact.
struct PointDepths {
  double deepest = 0;  ///< [m]; 0: none touches
  int touching = 0;
};
/// Returns those of a pair in one lane of a group that `reader` moved last. `block`: the numbers of
/// its block (rows, 16).
PointDepths pair_depths(const kernels::PairContact& pair, const PadReader& reader, int group,
                        int lane, const double* block);
/// The same for the points of a link above the ground of `view`.
PointDepths ground_depths(const kernels::GroundContact& ground, const kernels::ModelView& view,
                          const PadReader& reader, int group, int lane);

}  // namespace tangere
