// SPDX-License-Identifier: Apache-2.0
// Gaussian noise of every number of a picture, drawn from the counter-based stream, by (seed,
// episode, step, pixel).
#pragma once

#include <span>

#include "engine/model/camera_gains.hpp"

namespace tangere {

/// Adds noise of `deviation` [grey levels] to a row of a picture, (3, width). Of its pixels the
/// first is number `first` of the picture.
template <class T>
void add_camera_noise(const CameraKey& key, double deviation, int first, std::span<T> planes);

}  // namespace tangere
