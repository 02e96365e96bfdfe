// SPDX-License-Identifier: Apache-2.0
// Selects the bodies that a tactile sensor senses.
#pragma once

#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns the link that link `link` of a scene is rigidly joined to and that moves; -1: the world.
int moving_link(const Scene& scene, int link);

/// Returns the bodies that a sensor senses, as ascending indices into Scene::links: those with a
/// distance function that can move relative to its body, and
///  - that it names in `feels`, or
///  - without `feels`: that it does not name in `ignores`, and that no joint or loop connects with
///    its body unless a contact of the two is declared. Links that a joint connects overlap there
///    in most robots. Bodies rigidly joined to a neighbour are neighbours, and the world is none.
/// Throws InputError, which names sensor and body, for unknown names, for bodies that cannot be
/// sensed, and if both lists are given.
std::vector<int> sensed_bodies(const Scene& scene, const TactileDescription& sensor);

}  // namespace tangere
