// SPDX-License-Identifier: Apache-2.0
// Numbers that every tactile point has of its own: where it is, and its coefficients. Derivatives
// by them say where sensing pays, and fit a skin that is not the same everywhere.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

class Batch;

/// Of a point: its place x y z in its body's frame, its axes left as they are; then its own
/// coefficients (the sensor's times its factors).
inline constexpr int kPointNumbers = 7;

/// "x", "y", "z", "kn" …, and their units where a sensor has this law.
const char* point_number_name(int k);
const char* point_number_unit(int k, ContactLaw law);

/// All points of all sensors, one sensor after the other, each in the order of its field.
int tactile_points(const Model& model);
/// Of which these come before those of a sensor.
int first_tactile_point(const Model& model, int sensor);

/// kn, kt, mu and damping that a sensor has in an environment.
ContactCoefficients sensor_coefficients(const Batch& batch, int environment, int sensor);

/// The points of an array, row by row, with its axes: given one by one they have the same field.
std::vector<TactilePoint> list_points(const RectArray& array);

/// Adds to the own numbers of a sensor's points, (points, kPointNumbers), in their units; an array
/// becomes a list, which has neither rows nor columns. Throws InputError for a change of another
/// size, and for one of coefficients that the sensor has as 0: points have parts of the sensor's.
void add_to_points(TactileDescription& sensor, std::span<const double> change);

}  // namespace tangere
