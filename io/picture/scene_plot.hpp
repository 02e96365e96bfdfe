// SPDX-License-Identifier: Apache-2.0
// A picture of a scene at its start: bodies, the ways that joints move, sensors with their axes.
#pragma once

#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

/// From where the scene is seen, without perspective.
struct SceneCamera {
  double turn = 30;  ///< about z [degrees]; 0: from −y, so that x points right
  double lift = 25;  ///< above the horizon [degrees]
};

/// Returns an SVG drawing. Throws InputError for a scene that cannot be compiled.
std::string render_scene_svg(const Scene& scene, const SceneCamera& camera);

}  // namespace tangere
