// SPDX-License-Identifier: Apache-2.0
// Files of CAD programs have several closed parts that lie flush on each other. They are one solid.
#pragma once

#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Removes walls inside of a closed surface: overlaps of two coincident triangles with opposite
/// normals, as between blocks that lie flush on each other. They enclose nothing, but the distance
/// to them would be zero. The rest of such triangles is cut, and the surface stays closed. Returns
/// "", or a text about remaining walls: their share of the area, and a position.
std::string remove_walls(MeshShape& mesh);

}  // namespace tangere
