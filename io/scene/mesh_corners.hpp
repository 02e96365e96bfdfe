// SPDX-License-Identifier: Apache-2.0
// Corners of triangles: where they are, and which of them are one.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Of the longest side of a mesh: corners nearer than this differ by rounding.
inline constexpr double kRounding = 1e-8;

using Edge = std::pair<int, int>;  ///< two vertices

Vector3 place(const MeshShape& mesh, int vertex);
/// "(x y z)".
std::string place_text(const Vector3& at);
double distance(const Vector3& a, const Vector3& b);
/// The longest side of the box around all vertices.
double longest_side(const MeshShape& mesh);

/// For each vertex itself, or the first of those given that lies within `reach` of it.
std::vector<int> first_within(const MeshShape& mesh, const std::vector<int>& vertices,
                              double reach);

/// Gives triangles other corners, and leaves out those without an area and vertices without a
/// triangle.
MeshShape with_corners(const MeshShape& mesh, const std::vector<int>& corner_of);

}  // namespace tangere
