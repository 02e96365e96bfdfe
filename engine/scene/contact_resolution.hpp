// SPDX-License-Identifier: Apache-2.0
// Contacts whose points are too far apart to resolve the other body: geometry between contact
// points exerts no force (docs/contact.md).
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns the diameter of the largest ball that is centred on a shape's surface and holds none of
/// its contact points [m]; of a cuboid, whose points are a grid, the largest distance between
/// neighbours in the grid. 0: a shape without contact points or without a surface, or a sphere,
/// which touches with its surface. Of ellipsoids and meshes about 500 places of the surface are
/// tried.
double contact_point_gap(const Shape& shape);

/// A contact whose points are too far apart.
struct CoarseContact {
  std::size_t contact;  ///< index into Scene::pair_contacts
  double gap;           ///< contact_point_gap() of general_body [m]
  double width;         ///< the width of primitive_body that it was compared with [m]
  bool rims;            ///< it fits between no points, but those in the rims of faces may miss it
};

/// Width of primitive_body that a gap is compared with: the smallest or the second smallest. A
/// plate that lies on points is resolved though it is thin; a post's second width is its thickness.
enum class ComparedWidth { smallest, second };

/// Returns the contacts whose primitive_body fits between the points of general_body, unless a
/// contact of the same bodies the other way round has points that are near enough. Where the bodies
/// are equal cuboids, one above the other, fewer than four points along the edges of their largest
/// faces count as well (`rims`). Contacts that never push, and points of sensors that act as
/// contact points, are left out. A mesh counts as its box.
std::vector<CoarseContact> coarse_contacts(const Scene& scene, ComparedWidth compared);

/// Returns lines for the contacts whose second width fits, with both lengths and what helps: five
/// at most, and one with the number of the others.
std::vector<std::string> coarse_contact_lines(const Scene& scene);

/// Returns a line for each round body that may roll on the ground, or on a cuboid or a plane that
/// is fixed in the world, with contact points: it rolls over a polygon, whose corners stand out by
/// more than the body sinks in under its weight. Bodies that do not move freely, and those that
/// stand on an end, are left out.
std::vector<std::string> polygonal_rolling_lines(const Scene& scene);

}  // namespace tangere
