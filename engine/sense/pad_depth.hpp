// SPDX-License-Identifier: Apache-2.0
// How deep the shapes that a flat pad senses are below its points, along the pad's normal. Their
// undersides count (engine/layer/layer_depth.hpp); of several shapes the deepest. At the place y of
// an underside, with its slant n/φ', a shape that turns by θ and moves by ρ changes the depth by
//   δ̇ = (n/φ')·(ρ + θ × y),  and one whose size changes the distance d by δ̇ = -ḋ/φ'
#pragma once

#include <span>

#include "engine/model/compiled_model.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

/// Whether a shape may be below a point of a tile, or nearer than `beyond` [m]. A mesh has a
/// distance near its surface only, so it always may.
bool reaches_tile(const kernels::PadTiles& pad, int tile, const kernels::TouchShape& shape,
                  const kernels::Touch<double>& touch, double beyond = 0);

/// Computes δ ≥ 0 of every point, (points) [m]. `touch`: the shapes in pad axes
/// (PadReader::arguments()). `outward`: 1 or -1, whether the pad's z points out of the skin.
/// `deepest`: where depth ends [m]. NaN at all points where the place of a shape is none.
void read_depths(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                 int outward, double deepest, std::span<double> depth);

/// Pulls the cotangent of these depths, (points), back to the shapes: overwrites `touches`,
/// (targets), pad axes and origin. `sizes`: also by sizes of shapes. Where depth ends there is no
/// derivative.
void pull_back_depths(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                      int outward, double deepest, std::span<const double> depth_bar, bool sizes,
                      std::span<kernels::TouchCotangent<double>> touches);

}  // namespace tangere
