// SPDX-License-Identifier: Apache-2.0
// Computes a checksum of the contents of a scene's other files (meshes, lists of points, gels,
// tables).
#pragma once

#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns "none", or a checksum of all numbers that a scene's text alone does not contain.
std::string tables_of(const Scene& scene);

}  // namespace tangere
