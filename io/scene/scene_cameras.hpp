// SPDX-License-Identifier: Apache-2.0
// Cameras of a scene file, and what they see of abstract bodies.
#pragma once

#include "io/scene/scene_element.hpp"

namespace tangere {

/// Reads a camera. It may stand before the sensors or after them.
void read_camera(Scene& scene, const SceneElement& node);
/// Refuses a sensor that has the name of a camera.
void check_free_name(const Scene& scene, const SceneNode& node, const std::string& sensor);
/// Gives abstract bodies the surface that cameras see, if there are cameras: the hull of their
/// contact points.
void show_abstract_bodies(Scene& scene);

}  // namespace tangere
