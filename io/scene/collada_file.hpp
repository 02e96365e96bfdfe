// SPDX-License-Identifier: Apache-2.0
// Reads surfaces of COLLADA files (.dae), versions 1.4 and 1.5.
#pragma once

#include <string>

#include "io/scene/triangle_files.hpp"

namespace tangere {

/// Reads `triangles`, `trifans`, `tristrips`, `polylist` and `polygons` of all geometries that the
/// scene instances, where its nodes put them; without a scene, of all geometries. Positions are in
/// metres, by the file's `unit`. `up_axis` is ignored, as robot programs do. Throws IoError if the
/// file cannot be read, InputError with file:line for what is no COLLADA, and for skinned or
/// implicit surfaces.
RawMesh read_collada(const std::string& path);

}  // namespace tangere
