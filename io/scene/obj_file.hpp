// SPDX-License-Identifier: Apache-2.0
// Reads the vertices and faces of OBJ files.
#pragma once

#include <string>

#include "io/scene/triangle_files.hpp"

namespace tangere {

/// Reads `v` and `f` of an OBJ file. Faces are cut into triangles. Texture, normals, groups, curves
/// and materials are skipped. Throws IoError if the file cannot be read, InputError with file:line
/// if a line is none of an OBJ file, or if its shape is not made of vertices and faces.
RawMesh read_obj(const std::string& path);

}  // namespace tangere
