// SPDX-License-Identifier: Apache-2.0
// Convex hull of points, which replaces the surface of an open mesh.
#pragma once

#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns the convex hull of `points` (n, 3): a closed surface of triangles, with corners
/// anticlockwise seen from outside. Points closer than a millionth of the longest side count as
/// one. The same points have the same hull everywhere. Returns no triangles if all points lie in a
/// plane.
MeshShape convex_hull(const std::vector<double>& points);

}  // namespace tangere
