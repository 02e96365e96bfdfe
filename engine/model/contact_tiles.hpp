// SPDX-License-Identifier: Apache-2.0
// Contact points in tiles of neighbours.
#pragma once

#include <vector>

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Reorders (n, 3) points so that every `tile` consecutive ones are neighbours. Returns the tiles'
/// bounds, (tiles, 4).
/// `order`: out, if not null, where each point was before.
std::vector<double> sort_into_tiles(std::vector<double>& points, int tile,
                                    std::vector<int>* order = nullptr);
/// Stores points and bounds of a contact's tiles in the order in which vectors read them, padded to
/// whole tiles and whole vectors. `pair` already has its points.
void lay_out_tiles(CompiledModel& model, kernels::PairContact& pair,
                   const std::vector<double>& tiles);
/// Stores the tiles of a body on the ground, if it has many points. Its points keep their order.
void lay_out_tiles(CompiledModel& model, kernels::GroundContact& ground);

}  // namespace tangere
