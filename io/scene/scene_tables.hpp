// SPDX-License-Identifier: Apache-2.0
// What a scene has from files of its own (meshes, lists of points, tables), told apart by content:
// names may stay while the files change.
#pragma once

#include <string>

#include "engine/model/scene.hpp"

namespace tangere {

/// "none", or a checksum of all numbers that a scene's text alone does not hold.
std::string tables_of(const Scene& scene);

}  // namespace tangere
