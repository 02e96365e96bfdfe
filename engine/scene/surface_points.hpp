// SPDX-License-Identifier: Apache-2.0
// Points that cover the whole surface of a shape, each with the area for which it stands. Sums over
// them are integrals over the surface.
#pragma once

#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

struct SurfacePoints {
  std::vector<double> places;  ///< (n, 3) body frame [m]
  std::vector<double> areas;   ///< (n) [m²]; their sum is the area of the shape

  [[nodiscard]] std::size_t size() const { return areas.size(); }
};

/// Whether surface_points() covers a shape: it is bounded, and its surface is known.
bool has_surface(const Shape& shape);

/// Returns the area of a shape's surface [m²], an ellipsoid's to 1 %. The shape must have one.
double surface_area(const Shape& shape);

/// Returns about how many points surface_points() makes.
double expected_points(const Shape& shape, double pitch, double along);

/// Returns points whose neighbours are about `pitch` apart, and `along` apart along the axis of a
/// cylinder or capsule [m], both positive. No point is on an edge: each is in the middle of its
/// cell. Cells shrink towards the edges of cuboids and the rims of cylinders, so that the outermost
/// points are an eighth of a pitch from them. Rings around an axis are turned against each other.
/// The shape must have a surface.
SurfacePoints surface_points(const Shape& shape, double pitch, double along);

}  // namespace tangere
