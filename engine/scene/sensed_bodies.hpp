// SPDX-License-Identifier: Apache-2.0
// The bodies that a tactile sensor feels.
#pragma once

#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns the link that link `link` of a scene is rigidly joined to and that moves; -1: the world.
int moving_link(const Scene& scene, int link);

/// Returns the bodies that a sensor feels, as indices into Scene::links in their order: those with
/// a distance that move against its body, and
///  - that it names in `feels`, or
///  - without `feels`: that it does not name in `ignores`, and that no joint connects with its body
///    unless a contact of the two is declared. Links that a joint connects overlap there in most
///    robots. Bodies that are rigidly joined to a neighbour are neighbours, and the world is none.
/// Throws InputError, which names sensor and body, for names that no body has, for bodies that the
/// sensor cannot feel, and if both lists are given.
std::vector<int> sensed_bodies(const Scene& scene, const TactileDescription& sensor);

}  // namespace tangere
