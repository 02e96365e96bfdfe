// SPDX-License-Identifier: Apache-2.0
// Files of CAD programs have several closed parts that lie flush on each other. They are one solid.
#pragma once

#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Takes away walls inside of a closed surface: what two triangles have in common that face each
/// other in one place, as where blocks lie flush on each other. It encloses nothing, but the
/// distance to it would be zero. What is left of such triangles is cut anew, and the surface stays
/// closed. Returns "", or which walls are left: their share of the area, and a place.
std::string remove_walls(MeshShape& mesh);

}  // namespace tangere
