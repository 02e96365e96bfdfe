// SPDX-License-Identifier: Apache-2.0
// Reads the triangles of STL and PLY files, in text and in bytes. surface_files.hpp makes closed
// surfaces of them.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "engine/base/vector3.hpp"

namespace tangere {

/// Triangles as a file lists them: positions may repeat, and the surface may be open.
struct RawMesh {
  std::vector<Vector3> positions;             ///< [file's unit], at most a million each
  std::vector<std::array<int, 3>> triangles;  ///< indices of positions
  std::string fault;  ///< "", or a face that is no polygon, with its place in the file
};

/// Reads an STL file. Its normals are ignored: corners are anticlockwise seen from outside. Throws
/// IoError if the file cannot be read. Throws InputError if it is no STL file, with the line where
/// it is text.
RawMesh read_stl(const std::string& path);

/// Reads the elements `vertex` (x y z), `face` and `tristrips` (lists of vertex_indices) of a PLY
/// file, in any order. Faces are cut into triangles. Other elements and properties are skipped.
/// Throws like read_stl.
RawMesh read_ply(const std::string& path);

}  // namespace tangere
