// SPDX-License-Identifier: Apache-2.0
// Cuts a rectangular array of tactile points into 8×8 tiles and moves it into its pad's axes.
// tactile_points.cpp does this for lists.
#include "engine/model/compile_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "engine/model/body_shape.hpp"
#include "engine/model/tactile_points.hpp"
#include "engine/scene/frames.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

using kernels::Vec3;

namespace {

/// Returns +1 when axis0 × axis1 points out of the body. Pressure, a force into the body, then
/// reads positive.
int find_pressure_sign(const TactileDescription& d, const CompiledBody& body,
                       const Vec3<double>& normal) {
  if (d.pressure_sign) return *d.pressure_sign;
  const RectArray& a = d.array;
  return points_outward(body, 0.5 * (vec3_of(a.corner0) + vec3_of(a.corner1)), normal) >= 0 ? 1
                                                                                            : -1;
}

/// Spacing of the array's points in pad axes [m]: from row to row, and from column to column.
struct Lattice {
  double row_x, row_y, col_x, col_y;
};

/// Returns the number of points, along one axis, of a tile that starts at `first`.
int points_in(int first, int total) { return std::min(kernels::kTileSide, total - first); }

void place_tiles(CompiledSensor& s, const Lattice& lattice) {
  constexpr int kSide = kernels::kTileSide;
  s.tile_rows = (s.rows + kSide - 1) / kSide;
  s.tile_cols = (s.cols + kSide - 1) / kSide;
  const std::size_t padded =
      std::size_t(s.n_tiles() + kernels::kGroup - 1) / kernels::kGroup * kernels::kGroup;
  s.tile_x.assign(padded, kFarAway);
  s.tile_y.assign(padded, kFarAway);
  s.tile_z.assign(padded, 0.0);
  s.tile_radius.assign(padded, 0.0);
  s.offsets.assign(std::size_t{4} * 2 * kernels::kTactileTile, kFarAway);
  s.offsets_f.assign(s.offsets.size(), static_cast<float>(kFarAway));
  for (int t = 0; t < s.n_tiles(); ++t) {
    const int i0 = kSide * (t / s.tile_cols), j0 = kSide * (t % s.tile_cols);
    const int rows = points_in(i0, s.rows), cols = points_in(j0, s.cols);
    const double i = i0 + 0.5 * (rows - s.rows),
                 j = j0 + 0.5 * (cols - s.cols);  // from the array's middle
    s.tile_x[std::size_t(t)] = i * lattice.row_x + j * lattice.col_x;
    s.tile_y[std::size_t(t)] = i * lattice.row_y + j * lattice.col_y;
    const int kind = (cols < kSide ? 1 : 0) + (rows < kSide ? 2 : 0);
    s.tile_kind.push_back(kind);
    double square = 0;
    for (int k = 0; k < kernels::kTactileTile; ++k) {
      const int row = k / kSide, col = k % kSide;
      if (row >= rows || col >= cols) continue;
      const double di = row - 0.5 * (rows - 1), dj = col - 0.5 * (cols - 1);
      const double at[2] = {di * lattice.row_x + dj * lattice.col_x,
                            di * lattice.row_y + dj * lattice.col_y};
      for (int c = 0; c < 2; ++c) {
        const auto index = std::size_t((2 * kind + c) * kernels::kTactileTile + k);
        s.offsets[index] = at[c];
        s.offsets_f[index] = static_cast<float>(at[c]);
      }
      square = std::max(square, at[0] * at[0] + at[1] * at[1]);
    }
    // A tile that its radius rules out must not touch in either precision. The margin is far above
    // the rounding of both.
    s.tile_radius[std::size_t(t)] = std::sqrt(square) * (1 + 1e-5) + 1e-12;
  }
}

CompiledSensor compile_array(const TactileDescription& d, const CompiledBody& body,
                             SensorInfo& info) {
  CompiledSensor s;
  const RectArray& a = d.array;
  const Vec3<double> p0 = vec3_of(a.corner0), axis0 = vec3_of(a.axis0), axis1 = vec3_of(a.axis1);
  const Vec3<double> diagonal = vec3_of(a.corner1) - p0;
  const double step0 = a.rows > 1 ? dot(diagonal, axis0) / (a.rows - 1) : 0;
  const double step1 = a.cols > 1 ? dot(diagonal, axis1) / (a.cols - 1) : 0;
  const Vec3<double> normal = cross(axis0, axis1);
  if (!(std::abs(dot(normal, normal) - 1) < 1e-6))
    throw InputError(d.source.prefix() + "tactile sensor '" + d.name +
                     "': axis0 and axis1 must be perpendicular");

  s.link = body.link;
  s.rows = a.rows;
  s.cols = a.cols;
  // Orthonormal to the last digit. Where the scene's axes are not, the forces make up for it.
  const Vec3<double> e0 = (1 / std::sqrt(dot(axis0, axis0))) * axis0;
  const Vec3<double> e2 = (1 / std::sqrt(dot(normal, normal))) * normal;
  const Vec3<double> e1 = cross(e2, e0);
  const Vec3<double> middle =
      p0 + (0.5 * (a.rows - 1) * step0) * axis0 + (0.5 * (a.cols - 1) * step1) * axis1;
  s.pad =
      compose(body.frame, {{{{e0.x, e1.x, e2.x}, {e0.y, e1.y, e2.y}, {e0.z, e1.z, e2.z}}}, middle});
  place_tiles(s, {step0 * dot(axis0, e0), step0 * dot(axis0, e1), step1 * dot(axis1, e0),
                  step1 * dot(axis1, e1)});
  const Vec3<double> rows[3] = {axis0, axis1, -normal};
  for (int r = 0; r < 3; ++r) {
    const double row[3] = {dot(rows[r], e0), dot(rows[r], e1), dot(rows[r], e2)};
    for (int c = 0; c < 3; ++c) {
      s.axes[3 * r + c] = row[c];
      s.skewed |= std::abs(row[c] - (r != c ? 0 : r == 2 ? -1 : 1)) > 1e-12;
    }
  }
  info.rows = a.rows;
  info.cols = a.cols;
  info.pressure_sign = find_pressure_sign(d, body, normal);
  return s;
}

struct Sphere {
  Vec3<double> middle;
  double radius;
};

/// Returns a sphere around some tiles. Their radii have margins of their own.
Sphere sphere_around(const CompiledSensor& s, const std::vector<int>& tiles) {
  const auto middle = [&](const AlignedVector<double>& centres) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const int t : tiles) {
      low = std::min(low, centres[std::size_t(t)]);
      high = std::max(high, centres[std::size_t(t)]);
    }
    return 0.5 * (low + high);
  };
  Sphere out{{middle(s.tile_x), middle(s.tile_y), middle(s.tile_z)}, 0};
  for (const int tile : tiles) {
    const auto t = std::size_t(tile);
    const Vec3<double> away = Vec3<double>{s.tile_x[t], s.tile_y[t], s.tile_z[t]} - out.middle;
    out.radius = std::max(out.radius, (std::sqrt(dot(away, away)) + s.tile_radius[t]) * (1 + 1e-5));
  }
  return out;
}

/// Cuts the tiles into so many rows and columns of blocks. Returns a sphere around each.
std::vector<Sphere> blocks_of(const CompiledSensor& s, int rows, int cols) {
  std::vector<std::vector<int>> blocks(std::size_t(rows * cols));
  for (int t = 0; t < s.n_tiles(); ++t) {
    const int row = t / s.tile_cols * rows / s.tile_rows,
              col = t % s.tile_cols * cols / s.tile_cols;
    blocks[std::size_t(row * cols + col)].push_back(t);
  }
  std::vector<Sphere> spheres;
  for (const std::vector<int>& block : blocks)
    if (!block.empty()) spheres.push_back(sphere_around(s, block));
  return spheres;
}

/// Puts up to eight spheres around all tiles: those of the cut whose largest is smallest.
void bound_parts(CompiledSensor& s) {
  constexpr int kParts = kernels::kGroup;
  const auto largest = [](const std::vector<Sphere>& all) {
    return std::ranges::max(all, {}, &Sphere::radius).radius;
  };
  std::vector<Sphere> best = blocks_of(s, kParts, 1);
  for (int rows = kParts / 2; rows >= 1; rows /= 2)
    if (std::vector<Sphere> cut = blocks_of(s, rows, kParts / rows); largest(cut) < largest(best))
      best = std::move(cut);
  best.resize(kParts, best.front());  // twice is no harm
  s.parts.resize(std::size_t{4} * kParts);
  for (std::size_t k = 0; k < best.size(); ++k) {
    s.parts[k] = best[k].middle.x;
    s.parts[kParts + k] = best[k].middle.y;
    s.parts[2 * kParts + k] = best[k].middle.z;
    s.parts[3 * kParts + k] = best[k].radius;
  }
}

/// Puts spheres around all tiles, around the parts of the pad, and around eight tiles at a time.
void bound_pad(CompiledSensor& s) {
  constexpr int kEight = kernels::kGroup;
  const Sphere whole = blocks_of(s, 1, 1).front();
  s.middle[0] = whole.middle.x, s.middle[1] = whole.middle.y, s.middle[2] = whole.middle.z;
  s.reach = whole.radius;
  bound_parts(s);
  const auto padded = std::size_t((s.n_tiles() + kEight * kEight - 1) / (kEight * kEight) * kEight);
  s.eight_x.assign(padded, kFarAway);
  s.eight_y.assign(padded, kFarAway);
  s.eight_z.assign(padded, 0.0);
  s.eight_radius.assign(padded, 0.0);
  for (int first = 0; first < s.n_tiles(); first += kEight) {
    std::vector<int> tiles(std::size_t(std::min(kEight, s.n_tiles() - first)));
    std::iota(tiles.begin(), tiles.end(), first);
    const Sphere eight = sphere_around(s, tiles);
    const auto at = std::size_t(first / kEight);
    s.eight_x[at] = eight.middle.x, s.eight_y[at] = eight.middle.y, s.eight_z[at] = eight.middle.z;
    s.eight_radius[at] = eight.radius;
  }
}

}  // namespace

CompiledSensor compile_sensor(const TactileDescription& d, const CompiledBody& body,
                              SensorInfo& info) {
  if (d.law == ContactLaw::linear)
    throw InputError(d.source.prefix() + "tactile sensor '" + d.name +
                     "': law linear; expected clamped or paper");
  CompiledSensor s =
      d.points.empty() ? compile_array(d, body, info) : compile_points(d, body, info);
  s.law = d.law;
  bound_pad(s);
  info.name = d.name;
  info.body = d.body;
  info.points = s.points();
  info.every = d.every;
  return s;
}

}  // namespace tangere
