// SPDX-License-Identifier: Apache-2.0
// Reads files that bodies are made of: closed surfaces (OBJ, STL, PLY, COLLADA), contact points.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/scene.hpp"
#include "io/scene/triangle_files.hpp"

namespace tangere {

/// Contents of a surface file.
struct FileSurface {
  MeshShape faces;             ///< cut into triangles, equal corners welded; closed or open
  std::vector<double> points;  ///< (n, 3) all positions, of faces or not
  MeshShape closed;            ///< the faces without walls inside, if `fault` is ""
  std::string fault;           ///< why the faces are no closed surface with a volume, with the file
};

/// Reads an OBJ file, or an STL or PLY file where the path ends in .stl or .ply, in its own unit;
/// or a COLLADA file where it ends in .dae, in metres. Vertices that differ by rounding are merged
/// if the surface would otherwise be open, and inner walls of flush parts are removed. Throws
/// IoError if the file cannot be read, InputError with file:line if it is not of its format or has
/// no vertices.
FileSurface read_faces(const std::string& path);

/// Does the same with triangles that are read already. `name` stands in front of the fault.
FileSurface surface_of(const RawMesh& raw, const std::string& name);

/// Returns why triangles are no closed surface with a volume, or "".
std::string surface_fault(const MeshShape& mesh);

/// Returns the closed surface of a file. Throws like read_faces, and InputError with its fault.
MeshShape read_surface(const std::string& path);

/// Returns the convex hull of all points of a file. Throws like read_faces, and InputError if they
/// lie in a plane.
MeshShape read_hull(const std::string& path);

/// Scales a surface along each axis. Negative factors mirror it, and its outside stays outside.
void scale_surface(MeshShape& mesh, const Vector3& scale);

/// Returns `count` of the points, (n, 3): the first, then always the one that is farthest from
/// those before it, the first of equals. `count` is at most n.
std::vector<double> spread_points(const std::vector<double>& points, int count);

/// Returns the area of a surface, in the square of its vertices' unit.
double area_of(const MeshShape& mesh);

/// Returns `count` points on the surface, (n, 3), spread so that each stands for about the same
/// area. The same mesh has the same points everywhere.
std::vector<double> points_by_area(const MeshShape& mesh, int count);

/// Reads a count, then as many lines x y z. Returns (n, 3) numbers in the file's own unit. Throws
/// like read_surface.
std::vector<double> read_contact_points(const std::string& path);

}  // namespace tangere
