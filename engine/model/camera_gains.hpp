// SPDX-License-Identifier: Apache-2.0
// Factors of the channels of a camera in an episode, for a white balance that is not locked. They
// are drawn from the counter-based stream, by (seed, episode).
#pragma once

#include <array>
#include <cstdint>

#include "engine/scene/gel.hpp"

namespace tangere {

struct CameraKey {
  std::uint64_t seed = 0;  ///< of the batch, xor the bits of the sensor's or camera's name
  std::int64_t episode = 0, step = 0;
};

/// Returns the factors of R, G and B: 1 + `deviation` z.
std::array<double, kColours> camera_gains(const CameraKey& key, double deviation);

}  // namespace tangere
