// SPDX-License-Identifier: Apache-2.0
// How deep the shapes that a flat pad senses are below its points, along the pad's normal. Their
// undersides count (engine/sense/layer_depth.hpp); of several shapes the deepest.
#pragma once

#include <span>

#include "engine/model/compiled_model.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

/// Whether a shape may be below a point of a tile. A mesh has a distance near its surface only, so
/// it always may.
bool reaches_tile(const kernels::PadTiles& pad, int tile, const kernels::TouchShape& shape,
                  const kernels::Touch<double>& touch);

/// Computes δ ≥ 0 of every point, (points) [m]. `touch`: the shapes in pad axes
/// (PadReader::arguments()). `outward`: 1 or -1, whether the pad's z points out of the skin.
/// `deepest`: where depth ends [m].
void read_depths(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                 int outward, double deepest, std::span<double> depth);

}  // namespace tangere
