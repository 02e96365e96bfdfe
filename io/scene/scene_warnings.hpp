// SPDX-License-Identifier: Apache-2.0
// Warnings about valid scenes that are probably not as intended.
#pragma once

#include "engine/scene/scene.hpp"
#include "io/scene/scene_node.hpp"

namespace tangere {

/// Warns of tactile sensors that nothing can touch, whose body has no contact with another, or that
/// do not sense what touches their body.
void warn_of_sensors(const Scene& scene, const SceneNode& root);
/// Warns of joints that slide or turn about one axis and start outside their limits, whose springs
/// then push from the first step on. A start that <randomize> draws does not count.
void warn_of_starts(const Scene& scene, const SceneNode& root);

}  // namespace tangere
