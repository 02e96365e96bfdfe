// SPDX-License-Identifier: Apache-2.0
// Flaws of a camera: a factor for each channel in an episode, and Gaussian noise of every number of
// a picture. Both are drawn from the counter-based stream, by (seed, episode, step, pixel).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "engine/scene/gel.hpp"

namespace tangere {

struct CameraKey {
  std::uint64_t seed = 0;  ///< of the batch, xor the bits of the sensor's name
  std::int64_t episode = 0, step = 0;
};

/// Returns the factors of R, G and B: 1 + `deviation` z.
std::array<double, kColours> camera_gains(const CameraKey& key, double deviation);

/// Adds noise of `deviation` [grey levels] to a row of a picture, (3, width). Of its pixels the
/// first is number `first` of the picture.
template <class T>
void add_camera_noise(const CameraKey& key, double deviation, int first, std::span<T> planes);

}  // namespace tangere
