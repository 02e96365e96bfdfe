// SPDX-License-Identifier: Apache-2.0
// Contacts whose points are too far apart to feel the other body: what lies between contact points
// is not felt (docs/contact.md).
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "engine/model/scene.hpp"

namespace tangere {

/// Returns the diameter of the largest ball that is centred on a shape's surface and holds none of
/// its contact points [m]; of a cuboid, whose points are a grid, the largest distance between
/// neighbours in the grid. 0: a shape without contact points or without a surface, or a sphere, which
/// touches with its surface. Of ellipsoids and meshes about 500 places of the surface are tried.
double contact_point_gap(const Shape& shape);

/// A contact whose other body can come between the contact points.
struct CoarseContact {
  std::size_t contact;  ///< index into Scene::pair_contacts
  double gap;           ///< contact_point_gap() of general_body [m]
  double width;         ///< second smallest width of primitive_body [m]
};

/// Returns the contacts whose primitive_body fits between the points of general_body, unless a
/// contact of the same bodies the other way round has points that are near enough. Where the bodies
/// are equal cuboids, fewer than four points along an edge count as well: those in the rims of
/// faces that lie on each other may miss the face. Points of sensors that act as contact points are
/// left out.
std::vector<CoarseContact> coarse_contacts(const Scene& scene);

/// Returns a line for each of coarse_contacts(), with both lengths and what helps.
std::vector<std::string> coarse_contact_lines(const Scene& scene);

/// Returns a line for each round body that touches the ground with contact points: it rolls over a
/// polygon, whose corners stand out by more than the body sinks in under its weight.
std::vector<std::string> polygonal_rolling_lines(const Scene& scene);

}  // namespace tangere
