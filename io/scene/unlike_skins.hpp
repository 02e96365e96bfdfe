// SPDX-License-Identifier: Apache-2.0
// Sensors whose stiffness per area differs by orders from that of the contacts.
#pragma once

#include "engine/scene/scene.hpp"
#include "io/scene/scene_node.hpp"

namespace tangere {

/// Warns of tactile sensors whose stiffness per area differs by orders from that of a contact of
/// their body, with both stiffnesses.
void warn_of_unlike_skins(const Scene& scene, const SceneNode& root);

}  // namespace tangere
