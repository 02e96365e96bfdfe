// SPDX-License-Identifier: Apache-2.0
// Points are found by the shapes, tile by tile.
#include "engine/sense/pad_depth.hpp"

#include <algorithm>

#include "engine/sense/dense_tiles.hpp"
#include "engine/sense/layer_depth.hpp"
#include "kernels/contact/shapes/mesh.hpp"

namespace tangere {

using kernels::PadTiles;
using kernels::Touch;
using kernels::TouchShape;
using kernels::Vec3;

namespace {

/// Whether a place of the pad is in the box of a mesh: beyond its grid there is no distance.
bool is_near(const TouchShape& shape, const Touch<double>& touch, const Vec3<double>& place) {
  if (shape.grid == nullptr) return true;
  const Vec3<double> y = (1 / shape.size[0]) * transposed_times(touch.Q, place - touch.c);
  return kernels::near_box(*shape.grid, y, shape.grid->cell);
}

}  // namespace

bool reaches_tile(const PadTiles& pad, int tile, const TouchShape& s, const Touch<double>& touch) {
  if (s.grid != nullptr) return true;
  const Vec3<double> centre = {pad.x[tile], pad.y[tile], pad.z[tile]};
  return kernels::with_distance<double>(
      s.shape, Vec3<double>{s.size[0], s.size[1], s.size[2]}, [&](const auto& shape) {
        return !(distance_in_pad(shape, touch, centre).d > pad.radius[tile]);
      });
}

void read_depths(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                 int outward, double deepest, std::span<double> depth) {
  const PadTiles pad = sensor.tiles();
  std::fill(depth.begin(), depth.end(), 0.0);
  for (int k = 0; k < touch.n_touches; ++k) {
    const TouchShape& s = touch.shapes[k];
    const Touch<double>& t = touch.touches[k];
    kernels::with_distance<double>(
        s.shape, Vec3<double>{s.size[0], s.size[1], s.size[2]},
        [&](const auto& shape) {
          for (int tile = 0; tile < pad.tiles(); ++tile) {
            if (!reaches_tile(pad, tile, s, t)) continue;
            const double* const offset = pad.offsets + 2 * kernels::kTactileTile * pad.kind[tile];
            for_points_of_tile(pad, tile, [&](int slot, int index) {
              const Vec3<double> xi{pad.x[tile] + offset[slot],
                                    pad.y[tile] + offset[kernels::kTactileTile + slot], 0};
              if (!is_near(s, t, xi)) return;
              double& to = depth[static_cast<std::size_t>(index)];
              to = std::max(to, find_underside(shape, t, xi, outward, deepest).value_or(0));
            });
          }
        },
        s.grid);
  }
}

}  // namespace tangere
