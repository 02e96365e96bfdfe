// SPDX-License-Identifier: Apache-2.0
// Where bodies touch others: points on their surface by shape, ordered so that neighbours share a
// tile.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "engine/model/compiled_model.hpp"

namespace tangere {

namespace {

/// Surface nodes of the grid.
std::vector<double> points_of(const CuboidShape& shape) {
  const std::array<int, 3>& n = shape.contact_resolution;
  std::vector<double> points;
  const auto coordinate = [&](int axis, int i) {
    return -0.5 * shape.size[axis] + i * (shape.size[axis] / (n[axis] - 1));
  };
  const auto on_face = [&](int axis, int i) { return i == 0 || i == n[axis] - 1; };
  for (int i = 0; i < n[0]; ++i)
    for (int j = 0; j < n[1]; ++j)
      for (int k = 0; k < n[2]; ++k) {
        if (!on_face(0, i) && !on_face(1, j) && !on_face(2, k)) continue;
        points.insert(points.end(), {coordinate(0, i), coordinate(1, j), coordinate(2, k)});
      }
  return points;
}

/// `count` points around z, the first along x.
void add_ring(std::vector<double>& points, int count, double radius, double z) {
  for (int j = 0; j < count; ++j) {
    const double angle = 2 * M_PI * j / count;
    points.insert(points.end(), {radius * std::cos(angle), radius * std::sin(angle), z});
  }
}

std::vector<double> points_of(const CylinderShape& shape) {
  std::vector<double> points;
  for (const double z : {-0.5 * shape.length, 0.5 * shape.length}) {
    points.insert(points.end(), {0, 0, z});
    for (int k = 1; k <= shape.contact_rings; ++k)
      add_ring(points, shape.contact_angles, shape.radius * k / shape.contact_rings, z);
  }
  return points;
}

std::vector<double> points_of(const CapsuleShape& shape) {
  const double pole = 0.5 * shape.length + shape.radius;
  std::vector<double> points = {0, 0, pole, 0, 0, -pole};
  const int rings = shape.contact_rings;
  for (int k = 0; k < rings; ++k) {
    const double along =
        rings > 1 ? double(k) / (rings - 1) : 0.5;  // a single ring goes around the middle
    add_ring(points, shape.contact_angles, shape.radius, shape.length * (along - 0.5));
  }
  return points;
}

std::vector<double> points_of(const SphereShape&) { return {}; }
std::vector<double> points_of(const PlaneShape&) { return {}; }
std::vector<double> points_of(const MeshShape& shape) { return shape.vertices; }
std::vector<double> points_of(const AbstractShape& shape) { return shape.contact_points; }

/// Splits the longest side of a range in half until it fits a tile. Full tiles first, so only the
/// last is short.
void split(const std::vector<double>& points, std::vector<int>& order, std::size_t begin,
           std::size_t end, int tile) {
  if (end - begin <= std::size_t(tile)) return;
  double low[3], high[3];
  for (int a = 0; a < 3; ++a) low[a] = INFINITY, high[a] = -INFINITY;
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

}  // namespace

std::vector<double> contact_points(const Shape& shape) {
  return std::visit([](const auto& s) { return points_of(s); }, shape);
}

kernels::Solid solid_of(const Shape& shape, const CompiledBody& body) {
  const bool stretches = std::holds_alternative<CuboidShape>(shape) ||
                         std::holds_alternative<CylinderShape>(shape) ||
                         std::holds_alternative<CapsuleShape>(shape);
  return {body.frame, stretches, body.shape, body.size};
}

std::vector<double> sort_into_tiles(std::vector<double>& points, int tile) {
  const std::size_t n = points.size() / 3;
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  split(points, order, 0, n, tile);
  std::vector<double> sorted(points.size());
  for (std::size_t k = 0; k < n; ++k)
    std::copy_n(&points[3 * std::size_t(order[k])], 3, &sorted[3 * k]);
  points = std::move(sorted);
  std::vector<double> bounds;
  for (std::size_t begin = 0; begin < n; begin += std::size_t(tile)) {
    const std::size_t end = std::min(n, begin + std::size_t(tile));
    double low[3], high[3], centre[3];
    for (int a = 0; a < 3; ++a) low[a] = INFINITY, high[a] = -INFINITY;
    for (std::size_t k = begin; k < end; ++k)
      for (int a = 0; a < 3; ++a)
        low[a] = std::min(low[a], points[3 * k + a]),
        high[a] = std::max(high[a], points[3 * k + a]);
    for (int a = 0; a < 3; ++a) centre[a] = 0.5 * (low[a] + high[a]);
    double square = 0;
    for (std::size_t k = begin; k < end; ++k) {
      double r = 0;
      for (int a = 0; a < 3; ++a)
        r += (points[3 * k + a] - centre[a]) * (points[3 * k + a] - centre[a]);
      square = std::max(square, r);
    }
    // Rounded up: a bound that is short by one bit would be no bound.
    bounds.insert(bounds.end(),
                  {centre[0], centre[1], centre[2], std::sqrt(square) * (1 + 1e-12) + 1e-300});
  }
  return bounds;
}

}  // namespace tangere
