// SPDX-License-Identifier: Apache-2.0
// Cuts a list of tactile points into tiles of 64 neighbours each, in the body's axes.
#include "engine/model/tactile_points.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/model/body_shape.hpp"
#include "engine/scene/frames.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

using kernels::kTactileTile;
using kernels::Vec3;

namespace {

struct Box {
  double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};

  Box(const std::vector<TactilePoint>& points, std::span<const int> which) {
    for (const int i : which)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], points[std::size_t(i)].position[k]);
        high[k] = std::max(high[k], points[std::size_t(i)].position[k]);
      }
  }
  [[nodiscard]] std::size_t longest() const {
    std::size_t best = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (high[k] - low[k] > high[best] - low[best]) best = k;
    return best;
  }
  [[nodiscard]] Vec3<double> middle() const {
    return {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])};
  }
};

/// Halves a list across its longest side until every part is a tile. All tiles but the last are
/// full.
void cut_tiles(const std::vector<TactilePoint>& points, std::span<int> which) {
  const std::size_t tiles = (which.size() + kTactileTile - 1) / kTactileTile;
  if (tiles <= 1) {
    std::sort(which.begin(), which.end());
    return;
  }
  const std::size_t side = Box(points, which).longest(), first = (tiles + 1) / 2 * kTactileTile;
  std::nth_element(which.begin(), which.begin() + std::ptrdiff_t(first), which.end(),
                   [&](int a, int b) {
                     const double x = points[std::size_t(a)].position[side],
                                  y = points[std::size_t(b)].position[side];
                     return x != y ? x < y : a < b;
                   });
  cut_tiles(points, which.first(first));
  cut_tiles(points, which.subspan(first));
}

/// Returns row `row` of the numbers stored for point k of a tile.
double& entry(AlignedVector<double>& all, std::size_t rows, std::size_t tile, std::size_t row,
              std::size_t k) {
  return all[(tile * rows + row) * kTactileTile + k];
}

void place_point(const TactilePoint& p, std::size_t tile, std::size_t k, CompiledSensor& s) {
  const Vec3<double> offset =
      vec3_of(p.position) - Vec3<double>{s.tile_x[tile], s.tile_y[tile], s.tile_z[tile]};
  const double place[3] = {offset.x, offset.y, offset.z};
  for (std::size_t c = 0; c < 3; ++c) entry(s.offsets, 3, tile, c, k) = place[c];
  // The rows act on (f·x, f·y, -f·z), the kernels' force, so the sign of the third is turned back.
  for (std::size_t c = 0; c < 3; ++c) {
    const double sign = c == 2 ? -1 : 1;
    entry(s.frames, 9, tile, c, k) = sign * p.axis0[c];
    entry(s.frames, 9, tile, 3 + c, k) = sign * p.axis1[c];
    entry(s.frames, 9, tile, 6 + c, k) = -sign * p.normal[c];
  }
  if (!s.factors.empty())
    for (std::size_t c = 0; c < kPointCoefficients; ++c)
      entry(s.factors, kPointCoefficients, tile, c, k) = p.factors[c];
  s.tile_radius[tile] =
      std::max(s.tile_radius[tile], std::sqrt(dot(offset, offset)) * (1 + 1e-5) + 1e-12);
}

AlignedVector<float> narrowed(const AlignedVector<double>& from) {
  AlignedVector<float> to(from.size());
  std::transform(from.begin(), from.end(), to.begin(),
                 [](double x) { return static_cast<float>(x); });
  return to;
}

/// Returns the sign with which pressure reads positive where most normals point out of the body.
int sign_of_most(const std::vector<TactilePoint>& points, const CompiledBody& body) {
  std::ptrdiff_t outward = 0;
  for (const TactilePoint& p : points)
    outward += points_outward(body, vec3_of(p.position), vec3_of(p.normal)) >= 0 ? 1 : -1;
  return outward >= 0 ? 1 : -1;
}

}  // namespace

CompiledSensor compile_points(const TactileDescription& d, const CompiledBody& body,
                              SensorInfo& info) {
  const std::vector<TactilePoint>& points = d.points;
  CompiledSensor s;
  s.link = body.link;
  s.pad = body.frame;
  s.rows = static_cast<int>(points.size());
  s.cols = 1;
  s.tile_rows = (s.rows + kTactileTile - 1) / kTactileTile;
  s.tile_cols = 1;
  const auto tiles = std::size_t(s.tile_rows), slots = tiles * kTactileTile;
  const std::size_t padded = (tiles + kernels::kGroup - 1) / kernels::kGroup * kernels::kGroup;
  s.tile_x.assign(padded, kFarAway);
  s.tile_y.assign(padded, kFarAway);
  s.tile_z.assign(padded, 0.0);
  s.tile_radius.assign(padded, 0.0);
  s.tile_kind.resize(tiles);
  std::iota(s.tile_kind.begin(), s.tile_kind.end(), 0);
  s.offsets.assign(3 * slots, kFarAway);
  s.frames.assign(9 * slots, 0.0);
  const auto plain = [](const TactilePoint& p) { return p.factors == TactilePoint{}.factors; };
  if (!std::all_of(points.begin(), points.end(), plain))
    s.factors.assign(kPointCoefficients * slots, 1.0);
  s.index.assign(slots, 0);
  const std::span<int> order(s.index.data(), points.size());
  std::iota(order.begin(), order.end(), 0);
  cut_tiles(points, order);
  for (std::size_t t = 0; t < tiles; ++t) {
    const std::size_t first = t * kTactileTile,
                      count = std::min(points.size() - first, std::size_t(kTactileTile));
    const Vec3<double> middle = Box(points, order.subspan(first, count)).middle();
    s.tile_x[t] = middle.x, s.tile_y[t] = middle.y, s.tile_z[t] = middle.z;
    for (std::size_t k = 0; k < count; ++k)
      place_point(points[std::size_t(order[first + k])], t, k, s);
  }
  s.offsets_f = narrowed(s.offsets);
  s.frames_f = narrowed(s.frames);
  s.factors_f = narrowed(s.factors);
  info.rows = info.cols = 0;
  info.pressure_sign = d.pressure_sign.value_or(sign_of_most(points, body));
  return s;
}

}  // namespace tangere
