// SPDX-License-Identifier: Apache-2.0
// The surface of a body as flat faces, for pictures.
#pragma once

#include <vector>

#include "engine/model/scene.hpp"

namespace tangere {

/// Corners in order, anticlockwise seen from outside [m].
using Face = std::vector<Vector3>;

/// Returns the faces of a shape in its body frame. A half-space is a square with this half edge
/// [m]. A mesh of more than `most` triangles is thinned until it has no more. An abstract body has
/// none.
std::vector<Face> faces_of(const Shape& shape, double half_space, std::size_t most = 12000);

}  // namespace tangere
