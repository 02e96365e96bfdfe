// SPDX-License-Identifier: Apache-2.0
// The exact distance to a set of triangles. Boxes around halves of the set, and halves of these,
// leave out what is farther than the nearest triangle so far.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "kernels/numbers/linalg.hpp"

namespace tangere {

class TriangleTree {
 public:
  /// vertices: (n, 3). Both are copied.
  TriangleTree(std::span<const double> vertices, std::span<const std::array<int, 3>> triangles);

  /// Returns the squared distance from a place to the nearest triangle, and leaves that triangle in
  /// `nearest`. A search that begins at the triangle nearest to a neighbour is short. 0: any.
  [[nodiscard]] double squared_distance(const kernels::Vec3<double>& at, int& nearest) const;

 private:
  struct Box {
    double low[3], high[3];
  };
  struct Node {
    Box box;
    int first, count;  ///< count > 0: triangles first … first + count - 1; else children first and
                       ///< first + 1
  };
  struct Corners {
    kernels::Vec3<double> a, b, c;
  };
  void split(int node, std::span<Corners> all, int first);

  std::vector<Node> nodes_;
  std::vector<Corners> triangles_;
};

}  // namespace tangere
