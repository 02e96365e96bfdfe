// SPDX-License-Identifier: Apache-2.0
// The exact distance to a set of triangles at every node of a grid.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace tangere {

/// The nodes of a grid, z fastest.
struct GridNodes {
  int count[3];
  double origin[3], cell;  ///< the first node, and the distance between neighbours [m]

  [[nodiscard]] std::size_t all() const {
    return std::size_t(count[0]) * std::size_t(count[1]) * std::size_t(count[2]);
  }
  [[nodiscard]] std::size_t at(int i, int j, int k) const {
    return (std::size_t(i) * std::size_t(count[1]) + std::size_t(j)) * std::size_t(count[2]) +
           std::size_t(k);
  }
  [[nodiscard]] double place(int axis, int i) const { return origin[axis] + i * cell; }
};

/// Returns the distance from every node to the nearest triangle [m]: the least of those to all
/// triangles, bit by bit. vertices: (n, 3) [m]. A triangle without area may have no nearest place;
/// then it counts as far away.
std::vector<double> node_distances(std::span<const double> vertices,
                                   std::span<const std::array<int, 3>> triangles,
                                   const GridNodes& nodes);

}  // namespace tangere
