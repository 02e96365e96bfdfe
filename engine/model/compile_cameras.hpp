// SPDX-License-Identifier: Apache-2.0
// Cameras of a scene, placed on the bodies that carry them.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/scene.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere {

struct CompiledCamera {
  int body = -1;                   ///< that carries it; -1: the world
  kernels::Frame<double> frame{};  ///< right, down, forward; in the body's frame or the world's
  std::uint64_t name_bits = 0;     ///< of its noise
};

/// Returns the axes of a camera as columns, and its pinhole, in the frame in which it is described.
/// Of a camera without a direction they are not numbers.
kernels::Frame<double> camera_frame(const CameraDescription& camera);

/// Throws InputError for a body that does not exist, a name that a sensor or another camera has,
/// values outside their bounds, and a camera without a direction.
std::vector<CompiledCamera> compile_cameras(const Scene& scene);

}  // namespace tangere
