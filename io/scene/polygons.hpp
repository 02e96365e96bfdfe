// SPDX-License-Identifier: Apache-2.0
// Faces of modelling programs are polygons with any number of corners, and some are not convex.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "engine/base/vector3.hpp"

namespace tangere {

/// Cuts a polygon of n corners (indices of `positions`) into n - 2 triangles and appends them. A
/// polygon that a fan from its first corner covers becomes that fan. Any other is cut by ears in
/// the plane of its mean normal; edges that run to a hole and back are allowed. Returns "", or why
/// no cut covers the polygon exactly; a fan is appended then.
std::string cut_polygon(const std::vector<Vector3>& positions, const std::vector<int>& corners,
                        std::vector<std::array<int, 3>>& triangles);

}  // namespace tangere
