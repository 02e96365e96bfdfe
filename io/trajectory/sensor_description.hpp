// SPDX-License-Identifier: Apache-2.0
// Writes what both kinds of files say about a tactile sensor.
#pragma once

#include "io/hdf5/h5.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// Writes attributes of `object`: units, components, frame, body, pressure_sign and, for a
/// rectangular array, its place.
void describe_reading(const h5::Id& object, const SensorLayout& sensor, FieldForm form);
/// For a list of points, writes the datasets position, normal, axis0, axis1 (points, 3) and, if
/// they have an image, pixel (points, 2) below `group`.
void describe_points(const h5::Id& group, const SensorLayout& sensor);
/// Returns the name of a sensor's dataset in a trajectory: "force" for a field, else the form's.
const char* dataset_of(FieldForm form);
/// Says what the numbers of a reading are: "f.axis0, f.axis1; f is the force on the body".
std::string components_text(const SensorLayout& sensor, FieldForm form);

}  // namespace tangere
