// SPDX-License-Identifier: Apache-2.0
// Cuts what triangles of one plane have in common out of them.
#pragma once

#include <array>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Triangles of one plane, up to rounding, and how they face each other.
struct Wall {
  std::vector<std::array<int, 3>> faces;   ///< vertices of the mesh
  std::vector<std::vector<int>> opposite;  ///< by face: the faces that face it
};

/// The common area of two triangles that face each other.
double common_area(const MeshShape& mesh, const std::array<int, 3>& a, const std::array<int, 3>& b);

/// Returns triangles that take the place of a wall's faces in a closed surface: what no opposite
/// face covers, and triangles without area that keep the surface closed where corners lie on edges.
/// New corners are appended to the mesh's vertices. `same`: for each vertex the one in its place.
/// `size`: the longest side of the mesh. Returns false, with the mesh as it was, if the surface
/// would be open.
bool cut_wall(MeshShape& mesh, const Wall& wall, const std::vector<int>& same, double size,
              std::vector<std::array<int, 3>>& out);

}  // namespace tangere
