// SPDX-License-Identifier: Apache-2.0
// What a scene that can be read will probably not do as its author expects.
#pragma once

#include "engine/scene/scene.hpp"
#include "io/scene/scene_node.hpp"

namespace tangere {

/// Warns of tactile sensors that nothing can touch, whose body has no contact with another, or that
/// do not feel what touches their body.
void warn_of_sensors(const Scene& scene, const SceneNode& root);

}  // namespace tangere
