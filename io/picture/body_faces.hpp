// SPDX-License-Identifier: Apache-2.0
// The surface of a body as flat faces, for pictures.
#pragma once

#include <array>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Corners in order, anticlockwise seen from outside [m].
using Face = std::vector<Vector3>;

/// Returns the faces of a shape in its body frame. A half-space is a square with this half edge
/// [m]. A mesh of more than `most` triangles is thinned until it has no more. An abstract body has
/// none.
std::vector<Face> faces_of(const Shape& shape, double half_space, std::size_t most = 12000);

/// Triangles [m], counter-clockwise from outside, with the surface normals at their corners.
struct RoundSurface {
  std::vector<Vector3> vertices, normals;
  std::vector<std::array<int, 3>> triangles;
};
/// Returns the surface of a shape that has a distance and widths, seen from its middle. Throws
/// InputError for others.
RoundSurface round_surface_of(const Shape& shape);

}  // namespace tangere
