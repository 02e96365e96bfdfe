// SPDX-License-Identifier: Apache-2.0
// Writes what both kinds of files say about a tactile sensor.
#pragma once

#include "io/hdf5/h5.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// Writes attributes of `object`: units, components, frame, body, pressure_sign and, for a
/// rectangular array, its place. For a list of points, writes the datasets position, normal, axis0,
/// axis1 (points, 3) and, if they have an image, pixel (points, 2) below `group`.
void describe_sensor(const h5::Id& object, const h5::Id& group, const SensorLayout& sensor);

}  // namespace tangere
