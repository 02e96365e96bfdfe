// SPDX-License-Identifier: Apache-2.0
// The numbers of a scene that may differ between environments, and how they come to do so without
// being drawn.
#pragma once

#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns the numbers that <randomize> takes, but for those of the starting state: coefficients,
/// densities, sizes, effects and places of joints, gains of position motors, poses and light of
/// cameras. Compiling a scene in which one varies may still throw InputError, for example for the
/// size of a body with contact points.
std::vector<SceneNumber> variable_numbers(const Scene& scene);

/// Lets a number differ between environments. Each has the scene's value until
/// Batch::set_randomized_values() sets another. A number that varies already is drawn as before.
/// Throws InputError for a number that is not there.
void let_vary(Scene& scene, const SceneNumber& number);

}  // namespace tangere
