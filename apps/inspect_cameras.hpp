// SPDX-License-Identifier: Apache-2.0
// What `tangere inspect` says of cameras: where they are, and what a picture costs.
#pragma once

#include <cstddef>
#include <string>

#include "engine/scene/scene.hpp"

namespace tangere::apps {

/// What a picture of a camera takes: rays and triangles, and bytes in a file, before compression.
struct PictureCost {
  std::size_t rays = 0, triangles = 0;
  std::size_t rgb_bytes = 0, depth_bytes = 0, ids_bytes = 0;  ///< depth as float32
};
PictureCost picture_cost(const Scene& scene, const CameraDescription& camera);
/// "" for a scene without cameras.
std::string cameras_text(const Scene& scene);

}  // namespace tangere::apps
