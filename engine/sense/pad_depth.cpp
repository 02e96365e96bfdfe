// SPDX-License-Identifier: Apache-2.0
// Points are found by the shapes, tile by tile.
#include "engine/sense/pad_depth.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/layer/layer_depth.hpp"
#include "engine/sense/dense_tiles.hpp"
#include "kernels/contact/shapes/mesh.hpp"
#include "kernels/numbers/dual.hpp"

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

/// Derivatives of the distance at a place of the pad by the sizes of a shape.
Vec3<double> size_slopes(const TouchShape& s, const Touch<double>& touch,
                         const Vec3<double>& place) {
  using D = kernels::Dual<double>;
  const Vec3<double> y = transposed_times(touch.Q, place - touch.c);
  const Vec3<D> at{D(y.x), D(y.y), D(y.z)};
  Vec3<double> slopes{0, 0, 0};
  for (int k = 0; k < 3; ++k)
    kernels::with_distance<D>(
        s.shape,
        Vec3<D>{{s.size[0], k == 0 ? 1.0 : 0},
                {s.size[1], k == 1 ? 1.0 : 0},
                {s.size[2], k == 2 ? 1.0 : 0}},
        [&](const auto& shape) { (&slopes.x)[k] = distance_at(shape, at).d.epsilon; }, s.grid);
  return slopes;
}

/// Whether the place of every shape is a number.
bool is_placed(const kernels::TactileArgs<double>& touch) {
  for (int k = 0; k < touch.n_touches; ++k) {
    const Touch<double>& t = touch.touches[k];
    double sum = t.c.x + t.c.y + t.c.z;
    for (const auto& row : t.Q.m)
      for (const double x : row) sum += x;
    if (std::isnan(sum)) return false;
  }
  return true;
}

}  // namespace

bool reaches_tile(const PadTiles& pad, int tile, const TouchShape& s, const Touch<double>& touch,
                  double beyond) {
  if (s.grid != nullptr) return true;
  const Vec3<double> centre = {pad.x[tile], pad.y[tile], pad.z[tile]};
  return kernels::with_distance<double>(
      s.shape, Vec3<double>{s.size[0], s.size[1], s.size[2]}, [&](const auto& shape) {
        return !(distance_in_pad(shape, touch, centre).d > pad.radius[tile] + beyond);
      });
}

/// Calls f(target, shape, index of a point, its place ξ in pad axes, δ) for every shape below a
/// point, target by target.
template <class F>
static void for_undersides(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                           int outward, double deepest, const F& f) {
  const PadTiles pad = sensor.tiles();
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
              if (const auto depth = find_underside(shape, t, xi, outward, deepest))
                f(k, shape, static_cast<std::size_t>(index), xi, *depth);
            });
          }
        },
        s.grid);
  }
}

void read_depths(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                 int outward, double deepest, std::span<double> depth) {
  const bool placed = is_placed(touch);
  std::fill(depth.begin(), depth.end(), placed ? 0.0 : std::nan(""));
  if (!placed) return;
  for_undersides(sensor, touch, outward, deepest,
                 [&](int, const auto&, std::size_t index, const Vec3<double>&, double found) {
                   depth[index] = std::max(depth[index], found);
                 });
}

void pull_back_depths(const CompiledSensor& sensor, const kernels::TactileArgs<double>& touch,
                      int outward, double deepest, std::span<const double> depth_bar, bool sizes,
                      std::span<kernels::TouchCotangent<double>> touches) {
  for (kernels::TouchCotangent<double>& to : touches) to = {};
  std::vector<double> depth(depth_bar.size());
  read_depths(sensor, touch, outward, deepest, depth);
  std::vector<bool> done(depth.size());
  for_undersides(
      sensor, touch, outward, deepest,
      [&](int target, const auto& shape, std::size_t index, const Vec3<double>& xi, double found) {
        // Of shapes that are equally deep the first counts, as in a maximum.
        if (found != depth[index] || done[index] || !(found < deepest)) return;
        done[index] = true;
        if (depth_bar[index] == 0) return;
        const Touch<double>& t = touch.touches[target];
        const LayerDepth<double> at = underside_at(shape, t, xi, double(outward), found);
        const Vec3<double> force = depth_bar[index] * at.slant;
        kernels::TouchCotangent<double>& to = touches[static_cast<std::size_t>(target)];
        to.displacement += kernels::Vec6<double>{cross(at.place, force), force};
        if (!sizes) return;
        const double slope = -outward * distance_in_pad(shape, t, at.place).n.z;  // φ'
        to.size += (-depth_bar[index] / slope) * size_slopes(touch.shapes[target], t, at.place);
      });
}

}  // namespace tangere
