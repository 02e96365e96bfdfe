// SPDX-License-Identifier: Apache-2.0
// Orders contact points so that neighbours share a tile.
#include "engine/model/contact_tiles.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/model/group_contacts.hpp"

namespace tangere {

namespace {

/// Splits a range in half along its longest side until it fits a tile. Tiles are filled from the
/// front, so only the last one is not full.
void split(const std::vector<double>& points, std::vector<int>& order, std::size_t begin,
           std::size_t end, int tile) {
  if (end - begin <= std::size_t(tile)) return;
  double low[3], high[3];
  for (int a = 0; a < 3; ++a) low[a] = HUGE_VAL, high[a] = -HUGE_VAL;
  for (std::size_t k = begin; k < end; ++k)
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], points[3 * order[k] + a]);
      high[a] = std::max(high[a], points[3 * order[k] + a]);
    }
  int axis = 0;
  for (int a = 1; a < 3; ++a)
    if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
  std::stable_sort(order.begin() + std::ptrdiff_t(begin), order.begin() + std::ptrdiff_t(end),
                   [&](int i, int j) { return points[3 * i + axis] < points[3 * j + axis]; });
  const std::size_t tiles = (end - begin + tile - 1) / tile;
  const std::size_t middle = begin + (tiles / 2) * tile;
  split(points, order, begin, middle, tile);
  split(points, order, middle, end, tile);
}

/// Appends centre and radius of a ball around points begin … end - 1.
void append_ball(const double* points, std::size_t begin, std::size_t end,
                 std::vector<double>& out) {
  double low[3], high[3], centre[3];
  for (int a = 0; a < 3; ++a) low[a] = HUGE_VAL, high[a] = -HUGE_VAL;
  for (std::size_t k = begin; k < end; ++k)
    for (int a = 0; a < 3; ++a)
      low[a] = std::min(low[a], points[3 * k + a]), high[a] = std::max(high[a], points[3 * k + a]);
  for (int a = 0; a < 3; ++a) centre[a] = 0.5 * (low[a] + high[a]);
  double square = 0;
  for (std::size_t k = begin; k < end; ++k) {
    double r = 0;
    for (int a = 0; a < 3; ++a)
      r += (points[3 * k + a] - centre[a]) * (points[3 * k + a] - centre[a]);
    square = std::max(square, r);
  }
  // Rounded up: a bound that is too small by one bit would be no bound.
  out.insert(out.end(),
             {centre[0], centre[1], centre[2], std::sqrt(square) * (1 + 1e-12) + 1e-300});
}

/// Lays out balls, (n, 4), in the order in which vectors read them: (ceil(n/8), 4, 8), padded with
/// far balls to `count`.
AlignedVector<double> in_vectors(const std::vector<double>& balls, int count) {
  constexpr int kLanes = kernels::kGroup;
  AlignedVector<double> out(std::size_t((count + kLanes - 1) / kLanes * 4 * kLanes));
  for (int t = 0; t < int(out.size()) / 4; ++t)
    for (int c = 0; c < 4; ++c)
      out[std::size_t((t / kLanes * 4 + c) * kLanes + t % kLanes)] =
          std::size_t(4 * t) < balls.size() ? balls[std::size_t(4 * t + c)]
          : c < 3                           ? kernels::kFarAway
                                            : 0;
  return out;
}

}  // namespace

std::vector<double> sort_into_tiles(std::vector<double>& points, int tile,
                                    std::vector<int>* before) {
  const std::size_t n = points.size() / 3;
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  split(points, order, 0, n, tile);
  std::vector<double> sorted(points.size());
  for (std::size_t k = 0; k < n; ++k)
    std::copy_n(&points[3 * std::size_t(order[k])], 3, &sorted[3 * k]);
  points = std::move(sorted);
  if (before != nullptr) *before = order;
  std::vector<double> bounds;
  for (std::size_t begin = 0; begin < n; begin += std::size_t(tile))
    append_ball(points.data(), begin, std::min(n, begin + std::size_t(tile)), bounds);
  return bounds;
}

void lay_out_tiles(CompiledModel& m, kernels::PairContact& pair, const std::vector<double>& tiles) {
  constexpr int kTile = kernels::kContactTile;
  AlignedVector<double> points(std::size_t(pair.n_tiles) * 3 * kTile, kernels::kFarAway);
  for (int k = 0; k < pair.n_points; ++k)
    for (int c = 0; c < 3; ++c)
      points[std::size_t((k / kTile * 3 + c) * kTile + k % kTile)] = pair.points[3 * k + c];
  m.tile_storage.push_back(std::move(points));
  pair.tile_points = m.tile_storage.back().data();
  if (pair.weights != nullptr) {
    AlignedVector<double> weights(std::size_t(pair.n_tiles) * kTile);
    std::copy_n(pair.weights, pair.n_points, weights.begin());
    m.tile_storage.push_back(std::move(weights));
    pair.tile_weights = m.tile_storage.back().data();
  }
  m.tile_storage.push_back(in_vectors(tiles, pair.n_tiles));
  pair.tile_bounds = m.tile_storage.back().data();
  if (pair.grid == nullptr) return;
  constexpr int kEight = kernels::kGroup;
  std::vector<double> eights;
  for (int k = 0; k < pair.n_points; k += kEight)
    append_ball(pair.points, std::size_t(k), std::size_t(std::min(pair.n_points, k + kEight)),
                eights);
  m.tile_storage.push_back(in_vectors(eights, pair.n_tiles * (kTile / kEight)));
  pair.eight_bounds = m.tile_storage.back().data();
}

void lay_out_tiles(CompiledModel& m, kernels::GroundContact& ground) {
  if (ground.radius > 0 || ground.n_points <= kernels::kFewPoints) return;
  std::vector<double> points(ground.points, ground.points + 3 * ground.n_points);
  std::vector<int> order;
  sort_into_tiles(points, kernels::kLowTile, &order);
  const auto balls = [&](int size) {
    AlignedVector<double> all;
    for (int first = 0; first < ground.n_points; first += size) {
      kernels::Vec3<double> middle;
      double radius = 0;
      bound(&points[std::size_t(3 * first)], std::min(size, ground.n_points - first), middle,
            radius);
      all.insert(all.end(), {middle.x, middle.y, middle.z, radius});
    }
    return m.tile_storage.emplace_back(std::move(all)).data();
  };
  ground.tiles = balls(kernels::kLowTile);
  ground.blocks = balls(kernels::kLowTile * kernels::kLowBlock);
  ground.in_tiles = m.order_storage.emplace_back(std::move(order)).data();
  ground.n_tiles = (ground.n_points + kernels::kLowTile - 1) / kernels::kLowTile;
}

}  // namespace tangere
