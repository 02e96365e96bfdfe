// SPDX-License-Identifier: Apache-2.0
// What files of either kind say about a tactile sensor.
#pragma once

#include "io/hdf5/h5.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// Attributes of `object`: units, components, frame, body, pressure_sign and, of a rectangular
/// array, where it is. Of a list of points: datasets position, normal, axis0, axis1 (points, 3)
/// and, if they have an image, pixel (points, 2) below `group`.
void describe_sensor(const h5::Id& object, const h5::Id& group, const SensorLayout& sensor);

}  // namespace tangere
