// SPDX-License-Identifier: Apache-2.0
// How much inertia a motor moves when all other joints are free.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns 1/(M⁻¹)_jj for each dof j of `dofs` [kg or kg m²], armature included. M is the mass
/// matrix of the scene where all coordinates are 0 and no joint follows another. `tendons`: joints
/// without mass, behind all others, whose armature their leaders have. Throws what Model does.
std::vector<double> effective_inertias(Scene scene, const std::vector<int>& dofs,
                                       const std::set<std::string>& tendons);

}  // namespace tangere
