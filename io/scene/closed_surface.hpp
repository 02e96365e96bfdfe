// SPDX-License-Identifier: Apache-2.0
// Makes one closed surface of the triangles of a file.
#pragma once

#include <string>

#include "engine/scene/scene.hpp"
#include "io/scene/triangle_files.hpp"

namespace tangere {

/// Makes one vertex per position that a triangle uses, in order of use. Drops triangles that have
/// equal corners and so no area. Where the surface stays open, corners at its open edges that
/// differ by rounding (1e-8 of the mesh's longest side or less) become one.
MeshShape weld(const RawMesh& raw);

/// Returns where a surface is open, and how far apart corners are that nearly meet there, or "".
std::string open_edge(const MeshShape& mesh);

}  // namespace tangere
